// Refuses orientations that no hand can have: zero, torn on the I2C bus, too fast. Integers only.
#pragma once

#include <stdint.h>

namespace bunraku {

// The only such check: what reaches the box is signed, and so is what left this gate. The first reading after a
// reset or a long silence is believed only when the next one agrees with it.
class ImuGate {
 public:
  enum class Verdict : uint8_t { kAccepted, kRelocated, kZero, kNorm, kTorn, kRate, kUnconfirmed };

  void reset() { has_believed_ = has_refused_ = false; }  // after a restart of fusion

  // `orientation` w, x, y, z with 16384 for 1, as read at `now_us`. Every rule costs 0.5 s at most.
  Verdict admit(const int16_t (&orientation)[4], uint32_t now_us);

 private:
  struct Reading {
    int16_t orientation[4];
    uint32_t at_us;
  };

  Verdict refusal(const Reading& reading) const;
  bool has_moved(const Reading& reading, uint8_t needed);

  Reading believed_ = {};
  Reading refused_ = {};  // the newest of those that were not believed since
  uint8_t agreeing_ = 0;  // refused readings in a row that agree with one another
  bool has_believed_ = false;
  bool has_refused_ = false;
};

inline bool is_believed(ImuGate::Verdict verdict) {
  return verdict == ImuGate::Verdict::kAccepted || verdict == ImuGate::Verdict::kRelocated;
}

}  // namespace bunraku
