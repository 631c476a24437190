// The BNO055 as its host sees it: registers, pages, modes, waits, fusion at 100 Hz, and what goes wrong.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include <array>

#include "imu_model.h"

namespace bunraku {

class Bno055Model final : public ImuModel {
 public:
  static constexpr uint64_t kStartUpUs = 400'000, kResetUs = 650'000;     // datasheet 1.2, electrical
  static constexpr uint64_t kToFusionUs = 7'000, kToConfigUs = 19'000;    // table 3-6
  static constexpr uint64_t kUpdateUs = 10'000;                           // table 3-14

  // Power comes now. `seed` makes its unique id, its noise and its faults.
  Bno055Model(VirtualClock& clock, uint64_t seed, uint8_t address = 0x28);

  bool write(uint8_t address, uint8_t reg, const uint8_t* data, uint8_t count) override;
  bool read(uint8_t address, uint8_t reg, uint8_t* data, uint8_t count) override;
  void power_on() override;

  bool has_crystal = true;

  // State for tests and the world.
  const std::array<uint8_t, 16>& unique_id() const { return unique_id_; }
  bool is_fusing();
  Quaternion newest() override;
  Quaternion previous() override;
  uint8_t peek(uint8_t reg);                 // page 0, without the bus
  void poke(uint8_t reg, uint8_t value) { registers_[reg] = value; }

 private:
  struct Output {
    uint8_t bytes[0x15];  // registers 0x20 to 0x34: quaternion, linear acceleration, gravity, temperature
  };

  bool begin(uint8_t address, bool is_read, uint8_t reg, uint8_t count);
  void strike_states() override;
  void settle() override;
  void fuse(uint64_t now_us);
  void start_fusion(uint64_t at_us);
  void stop_fusion();
  void learn(const Quaternion& orientation);
  void reset_registers();
  Quaternion fused(uint64_t at_us) const;
  Output output(uint64_t at_us);
  bool write_byte(uint8_t reg, uint8_t value);
  bool write_mode(uint8_t mode);
  bool write_trigger(uint8_t value);
  uint8_t read_byte(uint8_t reg, const Output& data);
  uint8_t calibration() const;
  void corrupt(uint8_t reg, uint8_t* data, uint8_t count);

  std::array<uint8_t, 128> registers_{};

  bool is_frozen_ = false;
  bool is_radius_written_ = false;
  uint8_t page_ = 0;
  uint8_t mode_ = 0;         // in force
  uint8_t next_mode_ = 0;    // after the switch
  uint64_t switched_us_ = 0;
  uint64_t fusion_us_ = 0;   // when fusion started
  uint64_t updates_ = 0;     // outputs since
  double first_heading_ = 0;
  double turned_ = 0;        // radians since fusion started
  Quaternion last_learnt_{1, 0, 0, 0};
  bool has_learnt_ = false;  // offsets were restored: calibrated at once
  Output newest_{}, previous_{};
};

}  // namespace bunraku
