// The BNO055 as its host sees it: registers, pages, modes, waits, fusion at 100 Hz, and what goes wrong.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include <array>
#include <deque>
#include <functional>

#include "path.h"
#include "ports.h"
#include "random.h"
#include "virtual_clock.h"

namespace bunraku {

enum class ImuFault : uint8_t {
  kNack,          // the transaction is not acknowledged
  kStuckBus,      // the data line is held until recover()
  kZeroRead,      // all bytes read 0
  kTornRead,      // the first bytes from one update, the others from the next
  kFlippedBit,    // the top bit of one 16-bit value
  kBrownOut,      // back at power-on values; answers after 400 ms
  kSilentConfig,  // CONFIG mode, the settings kept
  kFrozen,        // fusion repeats its output until it is restarted
  kFusionError,   // system status 1, until a reset
};
constexpr size_t kImuFaults = 9;

struct ImuModelCounts {
  uint32_t transactions = 0;
  uint32_t illegal_writes = 0;     // to read-only registers, settings outside CONFIG mode, wrong values
  uint32_t illegal_reads = 0;      // offsets outside CONFIG mode
  uint32_t early_accesses = 0;     // during a mode switch, or during a reset that the host commanded
  uint32_t start_up_accesses = 0;  // in the 400 ms after power came
  uint32_t resets = 0;             // commanded by the host
  uint32_t recovers = 0;           // nine clocks
  uint32_t fusion_starts = 0;
  std::array<uint32_t, kImuFaults> injected{};
};

class Bno055Model final : public I2cBus {
 public:
  static constexpr uint64_t kStartUpUs = 400'000, kResetUs = 650'000;     // datasheet 1.2, electrical
  static constexpr uint64_t kToFusionUs = 7'000, kToConfigUs = 19'000;    // table 3-6
  static constexpr uint64_t kUpdateUs = 10'000;                           // table 3-14

  // Power comes now. `seed` makes its unique id, its noise and its faults.
  Bno055Model(VirtualClock& clock, uint64_t seed, uint8_t address = 0x28);

  bool write(uint8_t address, uint8_t reg, const uint8_t* data, uint8_t count) override;
  bool read(uint8_t address, uint8_t reg, uint8_t* data, uint8_t count) override;
  void recover() override;

  // Orientation of the chip's own axes in a world with z up; heading 0 is magnetic north.
  using Motion = std::function<Quaternion(uint64_t at_us)>;
  void set_orientation(const Quaternion& world_from_chip);
  void set_motion(Motion world_from_chip) { motion_ = std::move(world_from_chip); }
  void tap(uint64_t at_us, double peak_m_s2 = 30);  // a 20 ms half sine along the chip's z axis

  void power_on();  // also after power was there: a power cycle
  void power_off() { is_powered_ = false; }
  void inject(ImuFault fault, uint32_t times = 1);  // the next transactions that it can strike; states: now
  void set_probability(ImuFault fault, double per_transaction);

  double drift_degrees_minute = 0;           // IMUPLUS: its heading creeps
  double magnetic_disturbance_degrees = 0;   // NDOF: steel near the sensor turns north
  uint32_t stretch_us_byte = 180;            // clock stretching
  bool has_crystal = true;

  // State for tests and the world.
  const ImuModelCounts& counts() const { return counts_; }
  const std::array<uint8_t, 16>& unique_id() const { return unique_id_; }
  bool is_fusing();
  Quaternion newest();    // fusion's newest and second newest output, as the registers would give it unharmed
  Quaternion previous();
  uint8_t peek(uint8_t reg);                 // page 0, without the bus
  void poke(uint8_t reg, uint8_t value) { registers_[reg] = value; }

 private:
  struct Output {
    uint8_t bytes[0x15];  // registers 0x20 to 0x34: quaternion, linear acceleration, gravity, temperature
  };

  bool begin(uint8_t address, bool is_read, uint8_t reg, uint8_t count);
  bool strikes(ImuFault fault, bool can_strike);
  void strike_states();
  void spend(uint32_t bytes);
  void settle();
  void fuse(uint64_t now_us);
  void start_fusion(uint64_t at_us);
  void stop_fusion();
  void learn(const Quaternion& orientation);
  void reset_registers();
  Quaternion fused(uint64_t at_us) const;
  Output output(uint64_t at_us);
  double linear_z(uint64_t at_us) const;
  bool write_byte(uint8_t reg, uint8_t value);
  bool write_mode(uint8_t mode);
  bool write_trigger(uint8_t value);
  uint8_t read_byte(uint8_t reg, const Output& data);
  uint8_t calibration() const;
  void corrupt(uint8_t reg, uint8_t* data, uint8_t count);

  struct Tap {
    uint64_t at_us;
    double peak_m_s2;
  };

  VirtualClock& clock_;
  Random random_;
  uint8_t address_;
  Motion motion_;
  std::deque<Tap> taps_;
  std::array<uint8_t, 16> unique_id_;
  std::array<uint8_t, 128> registers_{};
  std::array<uint32_t, kImuFaults> pending_{};
  std::array<double, kImuFaults> probability_{};
  ImuModelCounts counts_;

  bool is_powered_ = true;
  bool is_stuck_ = false;
  bool is_frozen_ = false;
  bool is_commanded_reset_ = false;
  bool is_radius_written_ = false;
  uint8_t page_ = 0;
  uint8_t mode_ = 0;         // in force
  uint8_t next_mode_ = 0;    // after the switch
  uint64_t answers_us_ = 0;  // nothing answers before
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
