// A simulated inertial chip as bus, hand and trouble see it: what all of them have.
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

class ImuModel : public I2cBus {
 public:
  virtual ~ImuModel() = default;
  void recover() override;

  // Orientation of the chip's own axes in a world with z up; heading 0 is magnetic north.
  using Motion = std::function<Quaternion(uint64_t at_us)>;
  void set_orientation(const Quaternion& world_from_chip);
  void set_motion(Motion world_from_chip) { motion_ = std::move(world_from_chip); }
  void tap(uint64_t at_us, double peak_m_s2 = 30);  // a 20 ms half sine along the chip's z axis

  virtual void power_on() = 0;  // also after power was there: a power cycle
  void power_off() { is_powered_ = false; }
  void inject(ImuFault fault, uint32_t times = 1);  // the next transactions that it can strike; states: now
  void set_probability(ImuFault fault, double per_transaction);

  double drift_degrees_minute = 0;           // without the magnetometer: its heading creeps
  double magnetic_disturbance_degrees = 0;   // with it: steel near the sensor turns north
  uint32_t stretch_us_byte = 0;              // clock stretching

  const ImuModelCounts& counts() const { return counts_; }
  // Fusion's newest and second newest output, as the bus would give it unharmed.
  virtual Quaternion newest() = 0;
  virtual Quaternion previous() = 0;

 protected:
  ImuModel(VirtualClock& clock, uint64_t seed, uint8_t address);

  virtual void settle() = 0;         // the chip's events since the last look
  virtual void strike_states() = 0;  // faults that change its state
  bool is_reached(uint8_t address);  // counts, strikes; false: it does not answer
  bool strikes(ImuFault fault, bool can_strike);
  void spend(uint32_t bytes);
  double linear_z(uint64_t at_us) const;

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
  std::array<uint32_t, kImuFaults> pending_{};
  std::array<double, kImuFaults> probability_{};
  ImuModelCounts counts_;
  bool is_powered_ = true;
  bool is_stuck_ = false;
  bool is_commanded_reset_ = false;
  uint64_t answers_us_ = 0;  // nothing answers before
};

}  // namespace bunraku
