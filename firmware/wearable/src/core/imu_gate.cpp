// The gate in integers: angles are compared by the sine of their half, squared, so that no root is needed.
#include "imu_gate.h"

#include <string.h>

namespace bunraku {
namespace {

using Orientation = int16_t[4];
using Verdict = ImuGate::Verdict;

constexpr uint32_t kUnit = 1u << 28;                  // 16384 squared
constexpr uint32_t kNothing = kUnit / 4;              // half the length
constexpr uint32_t kShortest = kUnit / 10000 * 9801;  // 0.99 of the length; Q14 rounding gives 6e-5
constexpr uint32_t kLongest = kUnit / 10000 * 10201;  // 1.01 of the length
constexpr int32_t kLargestPart = 16548;               // 1.01: no sum of four squares overflows
constexpr int16_t kOne = 16384;
constexpr uint32_t kSlackMillidegrees = 3000;         // rounding, and a fusion that corrects itself
constexpr uint32_t kHalfTurnUs = 88500;               // 2000 degrees/s reach every orientation by then
constexpr uint32_t kLongestStepUs = 60000;            // while refusing, no more way than for this is allowed
constexpr uint32_t kTimeoutUs = 500000;               // after this long, what was believed is forgotten
constexpr uint8_t kInsisting = 5;                     // this many refused readings that agree are believed
constexpr uint8_t kConfirming = 2;                    // this many where nothing was believed before

uint32_t norm_squared(const Orientation& q) {
  uint32_t sum = 0;
  for (const int16_t part : q) sum += static_cast<uint32_t>(part * part);
  return sum;
}

// sin^2 of half the angle between two orientations, whichever sign they have; kUnit stands for 1.
uint32_t separation(const Orientation& a, const Orientation& b) {
  int32_t dot = 0;
  for (uint8_t i = 0; i < 4; ++i) dot += a[i] * b[i];
  const uint64_t norms = static_cast<uint64_t>(norm_squared(a)) * norm_squared(b);
  const uint64_t square = static_cast<uint64_t>(static_cast<int64_t>(dot) * dot);
  return static_cast<uint32_t>((norms - square) >> 28);  // never negative: Cauchy and Schwarz
}

// The largest separation that a hand can reach in this time: 2000 degrees/s, the range of the gyroscope.
// 2000 degrees/s are 1 millidegree of half an angle in 1 us; the sine is Bhaskara's, at most 2 % above.
uint32_t reach(uint32_t elapsed_us) {
  if (elapsed_us >= kHalfTurnUs) return kUnit;
  const uint32_t half_centidegrees = (kSlackMillidegrees / 2 + elapsed_us) / 10;
  const uint32_t product = half_centidegrees * (18000 - half_centidegrees) >> 10;
  const uint32_t sine = (4 * product << 13) / ((405000000u >> 10) - product);  // 8192 stands for 1
  return sine * sine << 2;
}

// A part near 1 with its top bit flipped reads near -1: unit norm still, and up to 20 degrees off, too small
// a step for the rate. It is known by its size: 2 minus what it was, so never below 1. An orientation whose
// sign changed as a whole has such a part only within 1 degree of an axis; refusing it there costs 0.1 s.
bool has_flipped_bit(const Orientation& before, const Orientation& raw) {
  for (uint8_t i = 0; i < 4; ++i) {
    if ((raw[i] >= kOne && before[i] < 0) || (raw[i] <= -kOne && before[i] > 0)) return true;
  }
  return false;
}

bool has_unit_norm(const Orientation& q, Verdict& refusal) {
  refusal = Verdict::kNorm;
  for (const int16_t part : q) {
    if (part > kLargestPart || part < -kLargestPart) return false;
  }
  const uint32_t norm = norm_squared(q);
  if (norm < kNothing) refusal = Verdict::kZero;
  return norm >= kShortest && norm <= kLongest;
}

}  // namespace

ImuGate::Verdict ImuGate::admit(const int16_t (&orientation)[4], uint32_t now_us) {
  Verdict refused;
  if (!has_unit_norm(orientation, refused)) return refused;
  Reading reading;
  memcpy(reading.orientation, orientation, sizeof reading.orientation);
  reading.at_us = now_us;
  if (has_believed_ && now_us - believed_.at_us > kTimeoutUs) has_believed_ = has_refused_ = false;
  refused = refusal(reading);
  const uint8_t needed = has_believed_ ? kInsisting : kConfirming;
  if (refused != Verdict::kAccepted && !has_moved(reading, needed)) return refused;
  const bool is_relocated = has_believed_ && refused != Verdict::kAccepted;
  believed_ = reading;
  has_believed_ = true;
  has_refused_ = false;
  return is_relocated ? Verdict::kRelocated : Verdict::kAccepted;
}

ImuGate::Verdict ImuGate::refusal(const Reading& reading) const {
  if (!has_believed_) return Verdict::kUnconfirmed;
  uint32_t elapsed_us = reading.at_us - believed_.at_us;
  if (has_refused_ && elapsed_us > kLongestStepUs) elapsed_us = kLongestStepUs;
  if (separation(believed_.orientation, reading.orientation) > reach(elapsed_us)) return Verdict::kRate;
  return has_flipped_bit(believed_.orientation, reading.orientation) ? Verdict::kTorn : Verdict::kAccepted;
}

// Whether the readings refused since the last believed one have agreed with one another for long enough.
bool ImuGate::has_moved(const Reading& reading, uint8_t needed) {
  uint32_t elapsed_us = reading.at_us - refused_.at_us;
  if (elapsed_us > kLongestStepUs) elapsed_us = kLongestStepUs;
  const bool agrees = has_refused_ && separation(refused_.orientation, reading.orientation) <= reach(elapsed_us) &&
                      !has_flipped_bit(refused_.orientation, reading.orientation);
  agreeing_ = agrees ? static_cast<uint8_t>(agreeing_ + 1) : 1;
  refused_ = reading;
  has_refused_ = true;
  return agreeing_ >= needed;
}

}  // namespace bunraku
