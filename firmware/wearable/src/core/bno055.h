// The BNO055: started, kept fusing and brought back, one bus transaction at a time, without ever waiting.
#pragma once

#include <stdint.h>

#include "imu_gate.h"
#include "ports.h"

namespace bunraku {

enum class Fusion : uint8_t { kImuPlus = 0x08, kNdof = 0x0C };  // values of OPR_MODE

struct ImuSettings {
  Fusion fusion;
  uint8_t axis_map;   // register 0x41; 0x24 leaves the axes as printed on the chip
  uint8_t axis_sign;  // register 0x42
  bool has_crystal = false;  // a 32 kHz crystal is fitted beside the chip (a steadier heading)
};

struct Sample {
  int16_t orientation[4];  // w, x, y, z; 16384 stands for 1
  uint32_t measured_us;
  uint8_t calibration;  // register 0x35
};

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

class Bno055 {
 public:
  explicit Bno055(I2cBus& bus) : bus_(bus) {}

  void start(const ImuSettings& settings, uint32_t now_us);  // power-on or settings changed

  // Start-up, mode changes, health checks, recovery: at most one bus transaction a call, never waits.
  void step(uint32_t now_us);

  // One burst read, gated (zero, norm, rate, torn). False: nothing to believe.
  bool sample(uint32_t now_us, Sample& out);

  // Linear acceleration, 1/100 m/s^2, polled at 100 Hz for taps. False: nothing new since the last call.
  bool acceleration(int16_t (&linear)[3]);

  bool is_running() const;                           // fusion runs and gives data
  bool has_failed() const { return has_failed_; }    // no chip after several tries; goes on trying
  bool has_id() const { return has_id_; }
  const uint8_t* unique_id() const { return unique_id_; }  // 16 bytes, page 1 register 0x50

  // 22 bytes, registers 0x55 to 0x6A, through CONFIG mode: the heading is lost. Nonsense is refused (counted);
  // a magnetometer radius outside 144..1280 is left out.
  void use_profile(const uint8_t* offsets22, uint32_t now_us);

  // Reads the offsets through CONFIG mode: the heading is lost. Given up if the chip fails meanwhile.
  void save_profile(uint32_t now_us);
  bool profile_ready(uint8_t* offsets22);  // true once after each save

  bool is_calibrated() const { return calibrated_looks_ >= 2; }  // gyr, acc (NDOF: and mag) at 3 for a second
  bool has_profile() const { return has_profile_; }
  uint8_t recoveries() const { return recoveries_; }  // rises when fusion was restarted; wraps
  const ImuCounts& counts() const { return counts_; }

 private:
  I2cBus& bus_;
  ImuGate gate_;
  ImuCounts counts_ = {};
  uint8_t unique_id_[16] = {};
  uint8_t calibrated_looks_ = 0;
  uint8_t recoveries_ = 0;
  bool has_failed_ = false;
  bool has_id_ = false;
  bool has_profile_ = false;
};

}  // namespace bunraku
