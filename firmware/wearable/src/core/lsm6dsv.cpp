// The driver: a look at the FIFO every 2 ms, a burst when it holds something, and the chip's settings once a second.
#include "lsm6dsv.h"

#include <string.h>

#include "lsm6dsv_registers.h"
#include "saturating.h"

namespace bunraku {
namespace {

using namespace lsm6dsv;

constexpr uint32_t kLookUs = 2000;
constexpr uint32_t kSearchUs = 1400000;  // longer, and there is no chip
constexpr uint32_t kNextLookUs = 10000, kFailedLookUs = 250000;
constexpr uint32_t kSilenceUs = 100000;
constexpr uint8_t kEmptyLooks = 20;  // and the loop has looked as often: it did not stall
constexpr uint32_t kHealthUs = 1000000, kStableUs = 10000000;
constexpr uint8_t kWordsABurst = 9;  // 1.5 ms
constexpr uint16_t kMostUnchanged = 240;  // noise changes a rate much sooner
constexpr uint8_t kMostMisses = 8, kMostDoubts = 3;
constexpr uint8_t kRepairsBeforeFailed = 6, kMostRepairs = 8;
constexpr uint32_t kBackOffUs = 50000;
constexpr float kNominalS = 1.0f / 240;
constexpr float kRadiansADegree = 3.14159265f / 180;
constexpr float kGravity = 9.80665f;
constexpr float kLargestJump =
    700 * kRadiansADegree;  // rad/s from one rate to the next; no arm does a tenth of it
constexpr uint8_t kMostJumps = 12;  // in a row; then the chip is believed
constexpr float kSettledDegreesS = 0.05f;  // the bias is known so well after a standstill
constexpr uint8_t kId[kImuIdBytes] = {'L', 'S', 'M', '6', 'D', 'S', 'V'};

constexpr struct {
  uint8_t reg, value;
} kSettings[] = {{kControl, kControlAsTold}, {kAccelerometerRange, k8G}, {kGyroscopeRange, k2000DegreesS},
                 {kFifoRates, kBothRates},   {kAccelerometer, k120Hz},   {kGyroscope, k240Hz},
                 {kFifoMode, kContinuous}};
constexpr uint8_t kSettingsCount = sizeof kSettings / sizeof kSettings[0];

}  // namespace

const uint8_t* Lsm6dsv::unique_id() const { return kId; }

bool Lsm6dsv::is_calibrated() const {
  return state_ == State::kRunning && vqf_.bias_sigma_degrees_s() < kSettledDegreesS;
}

void Lsm6dsv::start(const ImuSettings& settings, uint32_t now_us) {
  const bool is_remap = is_axis_remap(settings.axis_map, settings.axis_sign);
  turn_.set(is_remap ? settings.axis_map : uint8_t{0x24}, is_remap ? settings.axis_sign : uint8_t{0});
  has_failed_ = false;
  repairs_ = 0;
  if (state_ == State::kRunning) return;  // its fusion is ours, and goes on
  searching_us_ = now_us;
  if (address_ == 0) address_ = kAddress;
  search();
}

void Lsm6dsv::step(uint32_t now_us) {
  if (state_ == State::kOff || (pause_us_ != 0 && now_us - pause_from_us_ < pause_us_)) return;
  pause_us_ = 0;
  if (needs_bus_recovery_) {
    needs_bus_recovery_ = false;
    count(counts_.bus_recoveries);
    return bus_.recover();
  }
  if (misses_ >= kMostMisses && state_ != State::kSearch) {
    searching_us_ = now_us;
    search();
  }
  switch (state_) {
    case State::kSearch: return identify(now_us);
    case State::kReset: return reset(now_us);
    case State::kTrim: return read_trim();
    case State::kSettings: return write_setting(now_us);
    case State::kAwaitData:
    case State::kRunning: return waiting_ > 0 ? fetch() : look(now_us);
    case State::kOff: return;
  }
}

bool Lsm6dsv::sample(uint32_t, Sample& out) {
  if (state_ != State::kRunning || !is_new_) return false;
  is_new_ = false;
  float q[4];
  vqf_.orientation(q);
  for (uint8_t i = 0; i < 4; ++i)
    out.orientation[i] = static_cast<int16_t>(q[i] * 16384 + (q[i] < 0 ? -0.5f : 0.5f));
  out.measured_us = measured_us_;
  const float sigma = vqf_.bias_sigma_degrees_s();
  const uint8_t level = sigma < kSettledDegreesS ? 3 : sigma < 2 * kSettledDegreesS ? 2 : 1;
  out.calibration = static_cast<uint8_t>(level << 6 | level << 4 | 3 << 2);
  if (!is_believed(gate_.admit(out.orientation, measured_us_))) return false;
  turn_.apply(out.orientation);
  return true;
}

bool Lsm6dsv::acceleration(int16_t (&linear)[3]) {
  memcpy(linear, linear_, sizeof linear);
  const bool is_new = is_linear_new_;
  is_linear_new_ = false;
  return is_new;
}

void Lsm6dsv::search() {
  misses_ = doubts_ = setting_ = 0;
  waiting_ = 0;
  state_ = State::kSearch;
}

void Lsm6dsv::identify(uint32_t now_us) {
  uint8_t identity = 0;
  if (read(kWhoAmI, &identity, 1) && identity == kIdentity) {
    state_ = State::kReset;
    return;
  }
  if (now_us - searching_us_ > kSearchUs) has_failed_ = true;
  if (!has_run_) address_ ^= kAddress ^ kOtherAddress;
  pause(has_failed_ ? kFailedLookUs : kNextLookUs, now_us);
}

void Lsm6dsv::reset(uint32_t now_us) {
  if (!write(kControl, kReset)) return;
  pause(kStartUpUs, now_us);
  state_ = State::kTrim;
}

void Lsm6dsv::read_trim() {
  uint8_t fine;
  if (!read(kFrequencyFine, &fine, 1)) return;
  period_s_ = kNominalS / (1 + kShareAStep * static_cast<float>(static_cast<int8_t>(fine)));
  has_id_ = true;
  state_ = State::kSettings;
}

void Lsm6dsv::write_setting(uint32_t now_us) {
  if (!write(kSettings[setting_].reg, kSettings[setting_].value)) return;
  if (++setting_ < kSettingsCount) return;
  vqf_.begin(period_s_, 2 * period_s_);
  gate_.reset();
  memset(rate_, 0, sizeof rate_);
  unchanged_ = 0;
  empty_looks_ = odd_ = jumps_ = 0;
  looked_us_ = heard_us_ = checked_us_ = now_us;
  state_ = State::kAwaitData;
}

void Lsm6dsv::look(uint32_t now_us) {
  if (now_us - looked_us_ < kLookUs) return;
  if (now_us - checked_us_ >= kHealthUs) return check_settings(now_us);
  uint8_t status[2];
  if (!read(kFifoStatus, status, sizeof status)) return;
  looked_us_ = now_us;
  waiting_ = static_cast<uint16_t>(status[0] | (status[1] & 1) << 8);
  if ((status[1] & kOverrun) != 0 && state_ == State::kRunning) {
    count(counts_.overruns);
    ++recoveries_;  // it may have turned unseen
  }
  if (waiting_ > 0) {
    heard_us_ = now_us;
    empty_looks_ = 0;
    return;
  }
  if (empty_looks_ < kEmptyLooks) ++empty_looks_;
  if (now_us - heard_us_ > kSilenceUs && empty_looks_ >= kEmptyLooks) repair(counts_.silences, now_us);
}

// A chip that lost its supply is back at its power-on values.
void Lsm6dsv::check_settings(uint32_t now_us) {
  uint8_t bytes[kControl - kAccelerometer + 1];
  if (!read(kAccelerometer, bytes, sizeof bytes)) return;
  checked_us_ = now_us;
  const bool is_as_told = bytes[0] == k120Hz && bytes[1] == k240Hz && bytes[2] == kControlAsTold;
  doubts_ = is_as_told ? uint8_t{0} : static_cast<uint8_t>(doubts_ + 1);
  if (doubts_ > 0) checked_us_ -= kHealthUs;  // at once again: a single read may be wrong
  if (doubts_ >= kMostDoubts) return repair(counts_.brown_outs, now_us);
  if (state_ == State::kRunning && now_us - running_us_ >= kStableUs) repairs_ = 0;
}

void Lsm6dsv::fetch() {
  uint8_t words[kWordsABurst * kWordBytes];
  const uint8_t count = waiting_ < kWordsABurst ? static_cast<uint8_t>(waiting_) : kWordsABurst;
  if (!read(kFifoTag, words, static_cast<uint8_t>(count * kWordBytes))) return;
  waiting_ = static_cast<uint16_t>(waiting_ - count);
  for (uint8_t i = 0; i < count; ++i) take_word(words + i * kWordBytes);
  measured_us_ = looked_us_ - static_cast<uint32_t>(static_cast<float>(waiting_) * period_s_ * 2 / 3 * 1e6f);
  if (state_ == State::kAwaitData && vqf_.has_orientation()) {
    if (has_run_) ++recoveries_;
    has_run_ = true;
    has_failed_ = false;
    running_us_ = looked_us_;
    state_ = State::kRunning;
  }
  if (unchanged_ >= kMostUnchanged) repair(counts_.frozen, looked_us_);
}

// Two words of three are rates: for damaged ones the last rate is believed to have gone on.
void Lsm6dsv::take_word(const uint8_t* word) {
  const uint8_t tag = word[0] >> 3;
  if (tag == kGyroscopeTag) return take_rate(word + 1);
  if (tag == kAccelerometerTag) return take_acceleration(word + 1);
  count(counts_.damaged);
  if (++odd_ % 3 != 0) vqf_.feed_gyroscope(rate_);
}

void Lsm6dsv::take_rate(const uint8_t* parts) {
  const bool is_unchanged = memcmp(parts, seen_, sizeof seen_) == 0;
  unchanged_ = is_unchanged ? static_cast<uint16_t>(unchanged_ + 1) : uint16_t{0};
  memcpy(seen_, parts, sizeof seen_);
  float rate[3];
  bool is_jump = false;
  for (uint8_t i = 0; i < 3; ++i) {
    rate[i] = static_cast<float>(value(parts + 2 * i)) * (kDegreesSAStep * kRadiansADegree);
    const float jump = rate[i] - rate_[i];
    is_jump = is_jump || jump > kLargestJump || jump < -kLargestJump;
  }
  jumps_ = is_jump ? static_cast<uint8_t>(jumps_ + 1) : uint8_t{0};
  if (is_jump) count(counts_.damaged);
  if (!is_jump || jumps_ > kMostJumps) memcpy(rate_, rate, sizeof rate_);
  vqf_.feed_gyroscope(rate_);
  is_new_ = true;
}

// Taps are looked for in the acceleration without gravity, in the chip's axes.
void Lsm6dsv::take_acceleration(const uint8_t* parts) {
  float acceleration[3];
  for (uint8_t i = 0; i < 3; ++i)
    acceleration[i] = static_cast<float>(value(parts + 2 * i)) * (kGAStep * kGravity);
  vqf_.feed_accelerometer(acceleration);
  float q[4];
  vqf_.orientation(q);
  const float up[3] = {2 * (q[1] * q[3] - q[0] * q[2]), 2 * (q[2] * q[3] + q[0] * q[1]),
                       1 - 2 * (q[1] * q[1] + q[2] * q[2])};
  for (uint8_t i = 0; i < 3; ++i) linear_[i] = static_cast<int16_t>((acceleration[i] - kGravity * up[i]) * 100);
  is_linear_new_ = true;
}

void Lsm6dsv::repair(uint16_t& reason, uint32_t now_us) {
  count(reason);
  if (repairs_ < kMostRepairs) ++repairs_;
  if (repairs_ >= kRepairsBeforeFailed) has_failed_ = true;
  searching_us_ = now_us;
  search();
  pause(kBackOffUs << (repairs_ - 1) >> 1, now_us);
}

bool Lsm6dsv::has_answered(bool is_answered) {
  if (is_answered) {
    misses_ = 0;
    return true;
  }
  count(counts_.bus_errors);
  if (misses_ < 0xFF) ++misses_;
  if (misses_ % 2 == 0) needs_bus_recovery_ = true;
  return false;
}

}  // namespace bunraku
