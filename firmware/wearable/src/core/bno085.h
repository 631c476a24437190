// The BNO085 or BNO086: a sensor hub that fuses by itself and reports; started, watched and brought back.
#pragma once

#include <stdint.h>

#include "axis_remap.h"
#include "imu.h"
#include "imu_gate.h"
#include "ports.h"
#include "shtp.h"

namespace bunraku {

// Since power-on; they stop at 65535.
struct Bno085Counts {
  uint16_t bus_errors;
  uint16_t bus_recoveries;   // nine clocks
  uint16_t refused;          // orientations that the gate refused
  uint16_t relocated;        // orientations believed because they insisted
  uint16_t restarts;         // of the hub by itself: a brown-out, or its own watchdog
  uint16_t silences;         // no report for 0.3 s
  uint16_t unanswered;       // requests
  uint16_t refused_saves;    // the hub did not save its calibration
  uint16_t resets;           // commanded to the hub
};

// IMUPLUS is its game rotation vector, NDOF its rotation vector, both at 200 Hz, so that the newest is at most 5 ms old.
// It keeps its calibration in its own flash, and no copy of it leaves the chip.
class Bno085 final : public Imu {
 public:
  explicit Bno085(I2cBus& bus) : hub_(bus), bus_(bus) {}

  void start(const ImuSettings& settings, uint32_t now_us) override;
  void step(uint32_t now_us) override;
  bool sample(uint32_t now_us, Sample& out) override;  // no bus transaction
  bool acceleration(int16_t (&linear)[3]) override;

  bool is_running() const override { return state_ == State::kRunning; }
  bool has_failed() const override { return has_failed_; }
  bool has_id() const override { return has_id_; }
  const uint8_t* unique_id() const override { return unique_id_; }  // "BNO8", software, build, serial number

  bool use_profile(const uint8_t*) override { return false; }  // a BNO055's offsets mean nothing here
  void save_profile() override;
  bool profile_ready(uint8_t*) override { return false; }

  bool is_calibrated() const override { return is_calibrated_; }
  bool has_profile() const override { return has_profile_; }
  uint8_t recoveries() const override { return recoveries_; }
  const Bno085Counts& counts() const { return counts_; }

 private:
  enum class State : uint8_t {
    kOff,
    kSearch,  // does it answer? what it has to say comes first
    kAskProduct,
    kAskSerial,
    kAskCalibration,  // is one in its flash?
    kAskFeature,      // does it report as told already?
    kConfigure,
    kAwaitData,
    kRunning,
  };

  void search();
  void keep_looking(uint32_t now_us);
  void go(State state, uint32_t now_us);
  void next_question(uint32_t now_us);  // when the present one is answered or given up
  void look_at_clock(uint32_t now_us);
  bool ask(uint32_t now_us);  // true: a transaction was made
  bool ask_for_record(uint16_t record);
  bool configure(uint32_t now_us);
  bool set_feature(uint8_t report, uint32_t interval_us);
  bool command(uint8_t which, uint8_t accelerometer, uint8_t gyroscope, uint8_t magnetometer);
  bool say(const uint8_t* message, uint8_t count);
  bool has_answered(bool is_answered);

  void hear(uint32_t now_us);
  void take_cargo(uint32_t now_us);
  void take_answer(const uint8_t* message, uint8_t count, uint32_t now_us);
  void take_record(const uint8_t* message, uint32_t now_us);
  void take_reports(const uint8_t* cargo, uint8_t count);
  void take_report(const uint8_t* report, uint32_t measured_us);
  void take_orientation(const uint8_t* parts, uint32_t measured_us);
  void take_acceleration(const uint8_t* parts);
  void note_restart(uint32_t now_us);
  void lose_fusion();
  void begin_running(uint32_t now_us);
  void repair(uint16_t& reason, uint32_t now_us);
  void pause(uint32_t us, uint32_t now_us) { pause_us_ = us, pause_from_us_ = now_us; }
  uint8_t rotation_report() const;
  uint8_t levels() const;

  Shtp hub_;
  I2cBus& bus_;
  ImuGate gate_;
  AxisTurn turn_;
  Bno085Counts counts_ = {};
  ImuSettings settings_ = {};
  State state_ = State::kOff;

  uint32_t pause_us_ = 0, pause_from_us_ = 0;
  uint32_t searching_us_ = 0;  // since when
  uint32_t asked_us_ = 0;
  uint32_t announced_us_ = 0;  // when the header of the cargo was seen
  uint32_t heard_us_ = 0;      // the newest orientation
  uint32_t idle_us_ = 0;       // since when there is nothing to hear
  uint32_t running_us_ = 0;
  uint32_t low_us_ = 0;        // when a level was last too low
  uint32_t save_asked_us_ = 0;
  uint16_t quiet_looks_ = 0;   // without an orientation since the last
  uint8_t misses_ = 0;         // bus errors in a row
  uint8_t tries_ = 0;          // at the present question
  uint8_t setting_ = 0;
  uint8_t repairs_ = 0;        // since it last ran well for 10 s
  uint8_t commands_ = 0;
  uint8_t recoveries_ = 0;
  uint8_t accuracy_[4] = {};   // system, gyroscope, accelerometer, magnetometer

  uint8_t unique_id_[kImuIdBytes] = {};
  int16_t linear_[3] = {};
  Sample newest_ = {};

  bool has_failed_ = false;
  bool has_run_ = false;  // since power-on
  bool has_id_ = false;
  bool has_profile_ = false;
  bool is_asked_ = false;
  bool is_idle_ = false;  // nothing to hear at the last look
  bool is_interrupted_ = false;  // a cargo was announced, and an error came: it is still the same
  bool is_reading_ = false;  // in the middle of a cargo
  bool is_fusion_lost_ = false;  // restarted since it last ran
  bool is_reset_expected_ = true;  // power-on, or commanded
  bool is_orientation_new_ = false;
  bool is_linear_new_ = false;
  bool is_calibrated_ = false;
  bool needs_bus_recovery_ = false;
  bool wants_save_ = false, is_saving_ = false;
};

}  // namespace bunraku
