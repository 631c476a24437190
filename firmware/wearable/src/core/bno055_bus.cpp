// The driver's transactions, counted, patient with errors; and its waits, which a slow bus cannot shorten.
#include "bno055.h"
#include "bno055_registers.h"
#include "saturating.h"

namespace bunraku {

using namespace bno055;

bool Bno055::write(uint8_t reg, const uint8_t* data, uint8_t count) {
  return has_answered(bus_.write(address_, reg, data, count));
}

bool Bno055::read(uint8_t reg, uint8_t* data, uint8_t count) {
  return has_answered(bus_.read(address_, reg, data, count));
}

bool Bno055::has_answered(bool is_answered) {
  if (is_answered) {
    misses_ = 0;
    return true;
  }
  count(counts_.bus_errors);
  is_suspicious_ = true;
  if (misses_ < 0xFF) ++misses_;
  if (misses_ % 2 == 0) needs_bus_recovery_ = true;
  return false;
}

bool Bno055::is_pausing(uint32_t now_us) {
  if (pause_us_ == 0) return false;
  if (!is_pause_timed_) {
    is_pause_timed_ = true;
    pause_from_us_ = now_us;
  }
  if (now_us - pause_from_us_ < pause_us_) return true;
  pause_us_ = 0;
  return false;
}

bool Bno055::is_as_told(const uint8_t* units_to_sign, uint8_t mode) const {
  return units_to_sign[0] == kMetric && (units_to_sign[kMode - kUnits] & kModeBits) == mode &&
         units_to_sign[kPower - kUnits] == 0 && units_to_sign[kAxisMap - kUnits] == settings_.axis_map &&
         units_to_sign[kAxisSign - kUnits] == settings_.axis_sign;
}

}  // namespace bunraku
