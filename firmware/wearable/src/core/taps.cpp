// Quiet, a short burst, a second one, quiet: a hand that dances is never quiet on both sides of two bursts.
#include "taps.h"

namespace bunraku {
namespace {

// 1/100 m/s^2. A knuckle on the case gives well above 1 g; a hand at rest stays below 0.3 g.
constexpr uint32_t kSpike = 1000, kQuiet = 300;
constexpr uint32_t kSettledUs = 300'000;  // quiet before the first tap and after the second
constexpr uint32_t kLongestUs = 90'000;   // a tap rings this long; what stays loud longer is a movement
constexpr uint32_t kNearestUs = 100'000, kFurthestUs = 500'000;  // from the first tap to the second
constexpr uint32_t kGapUs = 60'000;       // missing samples: start again

uint32_t square(int16_t value) { return static_cast<uint32_t>(static_cast<int32_t>(value) * value); }

}  // namespace

bool Taps::feed(const int16_t (&linear)[3], uint32_t now_us) {
  if (now_us - fed_us_ > kGapUs) {
    *this = Taps();
    quiet_us_ = now_us;
  }
  fed_us_ = now_us;
  const uint32_t loudness = square(linear[0]) + square(linear[1]) + square(linear[2]);
  if (loudness > kQuiet * kQuiet) {
    if (!is_loud_) begin_burst(now_us);
    if (loudness > kSpike * kSpike) has_spike_ = true;
    return false;
  }
  if (is_loud_) end_burst(now_us);
  return rest(now_us);
}

void Taps::begin_burst(uint32_t now_us) {
  const uint32_t apart_us = now_us - first_us_;
  may_count_ = taps_ == 0 ? is_settled_ : taps_ == 1 && apart_us >= kNearestUs && apart_us <= kFurthestUs;
  is_loud_ = true;
  has_spike_ = is_settled_ = false;
  burst_us_ = now_us;
}

void Taps::end_burst(uint32_t now_us) {
  const bool is_tap = may_count_ && has_spike_ && now_us - burst_us_ <= kLongestUs;
  taps_ = is_tap ? static_cast<uint8_t>(taps_ + 1) : uint8_t{0};
  if (taps_ == 1) first_us_ = burst_us_;
  is_loud_ = false;
  quiet_us_ = now_us;
}

bool Taps::rest(uint32_t now_us) {
  if (taps_ == 1 && now_us - first_us_ > kFurthestUs) taps_ = 0;
  if (is_settled_ || now_us - quiet_us_ < kSettledUs) return false;
  is_settled_ = true;
  const bool is_double_tap = taps_ == 2;
  if (is_double_tap) taps_ = 0;
  return is_double_tap;
}

}  // namespace bunraku
