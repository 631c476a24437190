// The LSM6DSV as its host sees it: registers, its own clock, biases and noise, a FIFO, and what goes wrong.
#pragma once

#include <deque>

#include "imu_model.h"

namespace bunraku {

// Its faults: a zero read is a burst of zeros; a torn read changes a byte; a silent config switches both sensors off;
// a frozen one repeats its values; one with a fusion error fills its FIFO no more until it is reset.
class Lsm6dsvModel final : public ImuModel {
 public:
  static constexpr uint64_t kStartUpUs = 10'000;  // datasheet table 3: boot

  // Power comes now. `seed` makes its clock, its biases, its noise and its faults.
  Lsm6dsvModel(VirtualClock& clock, uint64_t seed, uint8_t address = 0x6A);

  bool write(uint8_t address, uint8_t reg, const uint8_t* data, uint8_t count) override;
  bool read(uint8_t address, uint8_t reg, uint8_t* data, uint8_t count) override;
  void power_on() override;

  Quaternion newest() override { return motion_(clock_.now_us()); }
  Quaternion previous() override { return motion_(clock_.now_us()); }
  Quaternion fused(uint64_t at_us, bool) const { return motion_(at_us); }  // the truth for the board's fusion

 private:
  using Word = std::array<uint8_t, 7>;

  void settle() override;
  void strike_states() override;
  void reset_registers();
  bool is_filling() const;
  double period_us() const;
  void measure(uint64_t at_us);
  void push(uint8_t tag, const std::array<double, 3>& steps);
  uint8_t read_byte(uint8_t reg);

  std::array<uint8_t, 128> registers_{};
  std::deque<Word> fifo_;
  std::array<double, 3> bias_{};  // degrees/s
  int8_t fine_ = 0;
  bool has_overrun_ = false;
  bool is_frozen_ = false, is_dry_ = false;
  uint64_t samples_ = 0;
  double next_us_ = 0;
  Word last_[2] = {};
};

}  // namespace bunraku
