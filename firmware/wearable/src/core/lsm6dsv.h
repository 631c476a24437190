// The LSM6DSV: rates and accelerations from its FIFO, fused by VQF on the board.
#pragma once

#include <stdint.h>

#include "axis_remap.h"
#include "imu.h"
#include "imu_gate.h"
#include "ports.h"
#include "vqf.h"

namespace bunraku {

// Since power-on; they stop at 65535.
struct Lsm6dsvCounts {
  uint16_t bus_errors;
  uint16_t bus_recoveries;  // nine clocks
  uint16_t damaged;         // words or values that no hand makes
  uint16_t overruns;        // of its FIFO: the loop stood still for more than a second
  uint16_t brown_outs;      // found without its settings
  uint16_t silences;        // no word for 0.1 s
  uint16_t frozen;          // the same rates for a second
};

// It has no magnetometer: NDOF is IMUPLUS. It has no number either, and its gyroscope's bias is found anew at each
// standstill: there is no calibration to keep.
class Lsm6dsv final : public Imu {
 public:
  explicit Lsm6dsv(I2cBus& bus) : bus_(bus) {}

  void start(const ImuSettings& settings, uint32_t now_us) override;
  void step(uint32_t now_us) override;
  bool sample(uint32_t now_us, Sample& out) override;  // no bus transaction
  bool acceleration(int16_t (&linear)[3]) override;

  bool is_running() const override { return state_ == State::kRunning; }
  bool has_failed() const override { return has_failed_; }
  bool has_id() const override { return has_id_; }
  const uint8_t* unique_id() const override;  // the same for all

  bool use_profile(const uint8_t*) override { return false; }
  void save_profile() override {}
  bool profile_ready(uint8_t*) override { return false; }

  bool is_calibrated() const override;  // it has stood still
  bool has_profile() const override { return is_calibrated(); }
  uint8_t recoveries() const override { return recoveries_; }
  const Lsm6dsvCounts& counts() const { return counts_; }

 private:
  enum class State : uint8_t { kOff, kSearch, kReset, kTrim, kSettings, kAwaitData, kRunning };

  void search();
  void identify(uint32_t now_us);
  void reset(uint32_t now_us);
  void read_trim();
  void write_setting(uint32_t now_us);
  void look(uint32_t now_us);
  void check_settings(uint32_t now_us);
  void fetch();
  void take_word(const uint8_t* word);
  void take_rate(const uint8_t* parts);
  void take_acceleration(const uint8_t* parts);
  void repair(uint16_t& reason, uint32_t now_us);
  bool write(uint8_t reg, uint8_t value) { return has_answered(bus_.write(address_, reg, &value, 1)); }
  bool read(uint8_t reg, uint8_t* data, uint8_t count) {
    return has_answered(bus_.read(address_, reg, data, count));
  }
  bool has_answered(bool is_answered);
  void pause(uint32_t us, uint32_t now_us) { pause_us_ = us, pause_from_us_ = now_us; }

  I2cBus& bus_;
  Vqf vqf_;
  ImuGate gate_;
  AxisTurn turn_;
  Lsm6dsvCounts counts_ = {};
  State state_ = State::kOff;

  uint32_t pause_us_ = 0, pause_from_us_ = 0;
  uint32_t searching_us_ = 0;
  uint32_t looked_us_ = 0, heard_us_ = 0, checked_us_ = 0, running_us_ = 0;
  uint32_t measured_us_ = 0;
  float period_s_ = 0;       // of the gyroscope
  float rate_[3] = {};       // rad/s, the newest that was believed
  uint16_t waiting_ = 0;     // words in the FIFO at the last look, without those fetched since
  uint16_t unchanged_ = 0;
  uint8_t empty_looks_ = 0;
  uint8_t odd_ = 0;          // damaged words since the last that were made up for
  uint8_t jumps_ = 0;        // rates in a row that were not believed
  uint8_t address_ = 0;
  uint8_t misses_ = 0;
  uint8_t doubts_ = 0;
  uint8_t setting_ = 0;
  uint8_t repairs_ = 0;
  uint8_t recoveries_ = 0;
  uint8_t seen_[6] = {};     // the newest rates as they came
  int16_t linear_[3] = {};

  bool has_failed_ = false;
  bool has_run_ = false;
  bool has_id_ = false;
  bool is_new_ = false;
  bool is_linear_new_ = false;
  bool needs_bus_recovery_ = false;
};

}  // namespace bunraku
