// The inertial unit as the core sees it, whatever chip it is: orientation, knocks, calibration, trouble.
#pragma once

#include <stdint.h>

namespace bunraku {

constexpr uint8_t kImuIdBytes = 16;
constexpr uint8_t kProfileBytes = 22;

// From accelerometer and gyroscope, or with the magnetometer too. The values are those of settings in flash.
enum class Fusion : uint8_t { kImuPlus = 0x08, kNdof = 0x0C };

struct ImuSettings {
  Fusion fusion;
  uint8_t axis_map;   // for each new axis, two bits: which of the chip's; 0x24 leaves them as printed
  uint8_t axis_sign;  // for each new axis, z in bit 0: whether it is turned round
  bool has_crystal = false;  // a 32 kHz crystal is fitted beside a BNO055 (a steadier heading)
};

struct Sample {
  int16_t orientation[4];  // w, x, y, z; 16384 stands for 1
  uint32_t measured_us;
  uint8_t calibration;  // system, gyroscope, accelerometer, magnetometer: two bits each, 3 is best
};

// Whether map and sign name each axis once and make a right-handed frame: 24 do.
bool is_axis_remap(uint8_t axis_map, uint8_t axis_sign);

// The same for every chip: it is started, kept fusing and brought back by step(), which never waits.
class Imu {
 public:
  // Power-on, or settings changed. A chip that fuses already as asked goes on: its heading is kept.
  // An invalid axis remap leaves the axes as they are.
  virtual void start(const ImuSettings& settings, uint32_t now_us) = 0;

  // Start-up, health checks, recovery, taps: at most one bus transaction a call.
  virtual void step(uint32_t now_us) = 0;

  // The newest orientation that a hand can have; at most one bus transaction. False: nothing to believe.
  virtual bool sample(uint32_t now_us, Sample& out) = 0;

  // Linear acceleration, 1/100 m/s^2, some 100 times a second, for taps. False: nothing new since the last call.
  virtual bool acceleration(int16_t (&linear)[3]) = 0;

  virtual bool is_running() const = 0;  // fusion runs and gives data
  virtual bool has_failed() const = 0;  // no chip, or none that gets well; goes on trying
  virtual bool has_id() const = 0;
  virtual const uint8_t* unique_id() const = 0;  // 16 bytes, once has_id()

  // A calibration that was saved before, 22 bytes that this kind of chip understands. It may cost the heading.
  // The same again: nothing. False: it makes no sense, and nothing is done.
  virtual bool use_profile(const uint8_t* profile22) = 0;

  // Saves the present calibration; it may cost the heading. Given up if the chip fails meanwhile.
  virtual void save_profile() = 0;

  // True once after each save, when there are bytes to be kept by board and box. A chip that keeps its calibration
  // in its own flash has none.
  virtual bool profile_ready(uint8_t* profile22) = 0;

  virtual bool is_calibrated() const = 0;   // for a second at least
  virtual bool has_profile() const = 0;     // a saved calibration is in use
  virtual uint8_t recoveries() const = 0;   // rises when fusion was restarted and the heading lost; wraps

 protected:
  ~Imu() = default;
};

}  // namespace bunraku
