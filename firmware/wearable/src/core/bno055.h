// The BNO055: started, kept fusing and brought back, one bus transaction at a time, without ever waiting.
#pragma once

#include <stdint.h>

#include "imu.h"
#include "imu_gate.h"
#include "ports.h"

namespace bunraku {

// Since power-on; they stop at 65535.
struct ImuCounts {
  uint16_t bus_errors;        // NACK or worse
  uint16_t bus_recoveries;    // nine clocks
  uint16_t zero;              // readings refused, by reason
  uint16_t norm;
  uint16_t torn;
  uint16_t rate;
  uint16_t relocated;         // readings believed because they insisted
  uint16_t brown_outs;        // found at its power-on values
  uint16_t silent_configs;    // found in CONFIG mode, its settings kept
  uint16_t frozen;            // the same 14 bytes for 10 s
  uint16_t fusion_errors;     // system status or error register
  uint16_t mode_refusals;     // a mode or a setting did not take
  uint16_t resets;            // commanded to the chip
  uint16_t refused_profiles;  // offsets that make no sense
};

class Bno055 final : public Imu {
 public:
  explicit Bno055(I2cBus& bus) : bus_(bus) {}

  // A new choice of crystal is told to the chip in any case, which then starts fusion again.
  void start(const ImuSettings& settings, uint32_t now_us) override;
  void step(uint32_t now_us) override;
  bool sample(uint32_t now_us, Sample& out) override;  // one burst read, gated (zero, norm, rate, torn)
  bool acceleration(int16_t (&linear)[3]) override;

  bool is_running() const override { return state_ == State::kRunning; }
  bool has_failed() const override { return has_failed_; }
  bool has_id() const override { return has_id_; }
  const uint8_t* unique_id() const override { return unique_id_; }  // page 1, register 0x50

  // Registers 0x55 to 0x6A, through CONFIG mode: the heading is lost. Nonsense is refused and counted; a
  // magnetometer radius outside 144..1280 is left out.
  bool use_profile(const uint8_t* offsets22) override;
  void save_profile() override;  // through CONFIG mode: the heading is lost
  bool profile_ready(uint8_t* offsets22) override;

  bool is_calibrated() const override { return calibrated_looks_ >= 2; }  // gyr, acc (NDOF: and mag) at 3
  bool has_profile() const override { return has_profile_; }
  uint8_t recoveries() const override { return recoveries_; }
  const ImuCounts& counts() const { return counts_; }

 private:
  enum class State : uint8_t {
    kOff,
    kSelectPage,  // start-up: is there a chip, and does it fuse as told already?
    kIdentify,
    kInspect,
    kEnterConfig,
    kReset,
    kSelectIdPage,
    kReadId,
    kLeaveIdPage,
    kSettings,
    kCheckSettings,
    kWriteOffsets,
    kReadOffsets,
    kEnterFusion,
    kCheckFusion,
    kAwaitData,
    kRunning,
  };
  enum class Errand : uint8_t { kConfigure, kRestore, kSave, kReset };  // what CONFIG mode is entered for

  // bno055.cpp: while fusion runs.
  void run(uint32_t now_us);
  bool is_sample_near(uint32_t now_us) const;
  void check_health(uint32_t now_us);
  void take_calibration(uint8_t calibration);
  void poll_acceleration(uint32_t now_us);
  void take_acceleration(const uint8_t* bytes, uint32_t now_us);
  void weigh(ImuGate::Verdict verdict);
  void look_for_frozen(const uint8_t* bytes);

  // bno055_start_up.cpp: from power-on to fusion, and back there.
  void advance(uint32_t now_us);
  void search(uint32_t now_us);
  void select_page(uint32_t now_us);
  void identify(uint32_t now_us);
  void inspect();
  void enter_config();
  void enter_config_for(Errand errand);
  void reset(uint32_t now_us);
  void select_id_page();
  void read_id();
  void leave_id_page();
  void write_setting();
  void check_settings();
  void write_offsets();
  void read_offsets();
  void enter_fusion();
  void check_fusion();
  void await_data(uint32_t now_us);
  void begin_running(uint32_t now_us);
  void repair(uint16_t& reason);
  void repair_fusion(uint8_t error);
  void keep_looking(uint32_t now_us);

  // bno055_bus.cpp: an error is counted and answered with patience, nine clocks, and a new search.
  bool write(uint8_t reg, const uint8_t* data, uint8_t count);
  bool write(uint8_t reg, uint8_t value) { return write(reg, &value, 1); }
  bool read(uint8_t reg, uint8_t* data, uint8_t count);
  bool has_answered(bool is_answered);
  void go(State state) { state_ = state, looks_ = 0; }
  void pause(uint32_t us) { pause_us_ = us, is_pause_timed_ = false; }
  bool is_pausing(uint32_t now_us);
  bool is_as_told(const uint8_t* units_to_sign, uint8_t mode) const;  // registers 0x3B to 0x42

  I2cBus& bus_;
  ImuGate gate_;
  ImuCounts counts_ = {};
  ImuSettings settings_ = {};
  State state_ = State::kOff;
  Errand errand_ = Errand::kConfigure;

  uint32_t pause_us_ = 0;  // counted from the first step after pause(), so that a slow bus cannot shorten it
  uint32_t pause_from_us_ = 0;
  uint32_t searching_us_ = 0;  // since when
  uint32_t sampled_us_ = 0;
  uint32_t sample_interval_us_ = 0;
  uint32_t checked_us_ = 0;
  uint32_t polled_us_ = 0;
  uint32_t running_us_ = 0;  // since when
  uint16_t unchanged_ = 0;   // readings in a row that were the same to the bit
  uint8_t address_ = 0x28;
  uint8_t looks_ = 0;    // at the present state's question
  uint8_t misses_ = 0;   // bus errors in a row
  uint8_t unusable_ = 0;  // readings in a row that were no orientation
  uint8_t repairs_ = 0;  // since it last ran well for 10 s
  uint8_t setting_ = 0;  // which one is written next
  uint8_t calibration_ = 0;
  uint8_t calibrated_looks_ = 0;
  uint8_t recoveries_ = 0;

  uint8_t unique_id_[16] = {};
  uint8_t profile_[22] = {};  // in use, or to be used
  uint8_t seen_[22] = {};     // what was read last, to be read again: offsets, unique id, or a reading
  int16_t linear_[3] = {};

  bool is_pause_timed_ = false;
  bool has_failed_ = false;
  bool has_run_ = false;      // since power-on
  bool has_id_ = false;
  bool has_profile_ = false;  // it is in the chip
  bool is_cold_ = false;             // the first look after power-on
  bool is_fusion_expected_ = false;  // it ran at the last check of the chip
  bool is_fusion_kept_ = false;      // found fusing as told: nothing is lost
  bool is_suspicious_ = false;  // look at the mode at once
  bool is_linear_new_ = false;
  bool is_profile_ready_ = false;
  bool is_profile_known_ = false;  // profile_ holds one
  bool needs_bus_recovery_ = false;
  bool wants_restore_ = false;
  bool wants_save_ = false;
  bool is_crystal_new_ = false;  // settings have changed it, and the chip does not tell by what it runs
};

}  // namespace bunraku
