// The driver's public functions, and what it hears while the hub runs.
#include "bno085.h"

#include <string.h>

#include "saturating.h"
#include "sh2.h"

namespace bunraku {
namespace {

using namespace sh2;

constexpr uint32_t kLookUs = 1000;             // between looks while there is nothing to hear
constexpr uint32_t kSilenceUs = 300000;
constexpr uint16_t kQuietLooks = 50;           // and the loop has looked as often: it did not stall
constexpr uint32_t kStableUs = 10000000;       // after running this long, earlier repairs are forgotten
constexpr uint32_t kCalibratedUs = 1000000;    // levels that held this long
constexpr uint32_t kLongestAgeUs = 200000;     // of a report; what says it is older has its time damaged
constexpr int32_t kLargestAcceleration = 8000;  // 1/100 m/s^2: at 8 g nothing larger is measured
constexpr uint8_t kMissesToRecover = 8;  // bus errors in a row
constexpr uint8_t kMedium = 2;                 // of the levels 0 to 3

uint8_t report_bytes(uint8_t report) {  // 0: none that was asked for
  switch (report) {
    case kGyroscope:
    case kMagneticField:
    case kLinearAcceleration: return kVectorBytes;
    case kGameRotationVector: return kGameRotationBytes;
    case kRotationVector: return kRotationBytes;
    case kTimeBase:
    case kTimeRebase: return kTimeBaseBytes;
    default: return 0;
  }
}

}  // namespace

void Bno085::start(const ImuSettings& settings, uint32_t now_us) {
  settings_ = settings;
  if (!is_axis_remap(settings.axis_map, settings.axis_sign)) settings_.axis_map = 0x24, settings_.axis_sign = 0;
  turn_.set(settings_.axis_map, settings_.axis_sign);
  has_failed_ = false;
  repairs_ = 0;
  searching_us_ = now_us;
  if (hub_.address() == 0) hub_.use(kAddress);
  search();
}

void Bno085::step(uint32_t now_us) {
  if (state_ == State::kOff) return;
  if (pause_us_ != 0 && now_us - pause_from_us_ < pause_us_) return;
  pause_us_ = 0;
  if (needs_bus_recovery_) {
    needs_bus_recovery_ = false;
    count(counts_.bus_recoveries);
    return bus_.recover();
  }
  look_at_clock(now_us);
  if (pause_us_ != 0 || (!is_reading_ && ask(now_us)) || pause_us_ != 0) return;
  hear(now_us);
}

// The newest report, said once: a reading that was not renewed would hide that the hub has stopped.
bool Bno085::sample(uint32_t, Sample& out) {
  if (state_ != State::kRunning || !is_orientation_new_) return false;
  is_orientation_new_ = false;
  out = newest_;
  out.calibration = levels();
  return true;
}

bool Bno085::acceleration(int16_t (&linear)[3]) {
  memcpy(linear, linear_, sizeof linear);
  const bool is_new = is_linear_new_;
  is_linear_new_ = false;
  return is_new;
}

void Bno085::save_profile() { wants_save_ = state_ == State::kRunning; }

void Bno085::hear(uint32_t now_us) {
  if (is_idle_ && now_us - idle_us_ < kLookUs) return;
  is_idle_ = false;
  const bool is_header = !is_reading_;
  const Shtp::Heard heard = hub_.listen();
  is_reading_ = heard == Shtp::Heard::kPart;
  const bool is_answered = has_answered(heard != Shtp::Heard::kError);
  if (is_header && is_answered && !is_interrupted_) announced_us_ = now_us;
  is_interrupted_ = !is_answered && (!is_header || is_interrupted_);
  if (heard == Shtp::Heard::kCargo) return take_cargo(now_us);
  if (is_answered && heard != Shtp::Heard::kNothing) return;
  if (!is_answered) hub_.forget();  // no hub, trouble, or a hub that says no when it has nothing to say
  is_idle_ = true;
  idle_us_ = now_us;
  if (quiet_looks_ < kQuietLooks) ++quiet_looks_;
  if (state_ == State::kSearch) go(State::kAskProduct, now_us);  // it has said all, or never will: it is asked
}

void Bno085::take_cargo(uint32_t now_us) {
  const uint8_t* cargo = hub_.cargo();
  switch (hub_.channel()) {
    case kExecutable:
      if (hub_.count() == 1 && cargo[0] == kResetComplete) note_restart(now_us);
      return;
    case kControl: return take_answer(cargo, hub_.count(), now_us);
    case kInput: {
      const uint32_t before_us = heard_us_;
      take_reports(cargo, hub_.count());
      const bool is_heard = heard_us_ != before_us;
      if (is_heard) quiet_looks_ = 0;
      if (is_heard && state_ == State::kAwaitData) begin_running(now_us);
      return;
    }
    default: return;
  }
}

// Its own settings are gone with its fusion: what it does now is report nothing.
void Bno085::note_restart(uint32_t now_us) {
  if (!is_reset_expected_) count(counts_.restarts);
  is_reset_expected_ = false;
  lose_fusion();
  if (state_ == State::kSearch) return;
  searching_us_ = now_us;
  search();
}

void Bno085::lose_fusion() {
  is_fusion_lost_ = true;
  is_calibrated_ = is_saving_ = is_orientation_new_ = false;
  memset(accuracy_, 0, sizeof accuracy_);
  gate_.reset();
}

// A cargo: the time base first, then reports with their delays from it.
void Bno085::take_reports(const uint8_t* cargo, uint8_t count) {
  uint32_t age_us = 0;
  uint8_t at = 0;
  while (at < count) {
    const uint8_t* report = cargo + at;
    const uint8_t bytes = report_bytes(report[0]);
    if (bytes == 0 || at + bytes > count) return;
    if (report[0] == kTimeBase) {
      age_us = long_value(report + 1) * kTickUs;
    } else if (report[0] == kTimeRebase) {
      age_us -= long_value(report + 1) * kTickUs;
    } else {
      const uint32_t delay = static_cast<uint32_t>((report[2] & ~kAccuracyBits) << 6 | report[3]);
      const uint32_t old_us = age_us - delay * kTickUs;
      take_report(report, announced_us_ - (old_us <= kLongestAgeUs ? old_us : 0));
    }
    at = static_cast<uint8_t>(at + bytes);
  }
}

void Bno085::take_report(const uint8_t* report, uint32_t measured_us) {
  const uint8_t accuracy = report[2] & kAccuracyBits;
  const uint8_t* parts = report + 4;
  switch (report[0]) {
    case kGyroscope: accuracy_[1] = accuracy; return;
    case kMagneticField: accuracy_[3] = accuracy; return;
    case kLinearAcceleration: accuracy_[2] = accuracy; return take_acceleration(parts);
    default:
      if (report[0] != rotation_report()) return;
      accuracy_[0] = accuracy;
      take_orientation(parts, measured_us);
  }
}

// x, y, z, w with 14 bits behind the point.
void Bno085::take_orientation(const uint8_t* parts, uint32_t measured_us) {
  heard_us_ = measured_us;
  Sample sample = {{signed_value(parts + 6), signed_value(parts), signed_value(parts + 2),
                    signed_value(parts + 4)},
                   measured_us,
                   0};
  const ImuGate::Verdict verdict = gate_.admit(sample.orientation, measured_us);
  if (verdict == ImuGate::Verdict::kRelocated) count(counts_.relocated);
  if (!is_believed(verdict)) {
    if (verdict != ImuGate::Verdict::kUnconfirmed) count(counts_.refused);
    return;
  }
  turn_.apply(sample.orientation);
  newest_ = sample;
  is_orientation_new_ = true;
}

// m/s^2 with 8 bits behind the point. Their axes stay the chip's: a knock is one from whatever side.
void Bno085::take_acceleration(const uint8_t* parts) {
  int16_t linear[3];
  for (uint8_t i = 0; i < 3; ++i) {
    const int32_t part = signed_value(parts + 2 * i) * 100 / 256;
    if (part > kLargestAcceleration || part < -kLargestAcceleration) return;
    linear[i] = static_cast<int16_t>(part);
  }
  memcpy(linear_, linear, sizeof linear_);
  is_linear_new_ = true;
}

void Bno085::look_at_clock(uint32_t now_us) {
  if (state_ != State::kRunning) return;
  const bool is_field_needed = settings_.fusion == Fusion::kNdof;
  const bool is_low =
      accuracy_[1] < kMedium || accuracy_[2] < kMedium || (is_field_needed && accuracy_[3] < kMedium);
  if (is_low) low_us_ = now_us;
  is_calibrated_ = !is_low && (is_calibrated_ || now_us - low_us_ >= kCalibratedUs);
  if (now_us - running_us_ >= kStableUs) repairs_ = 0;
  if (now_us - heard_us_ > kSilenceUs && quiet_looks_ >= kQuietLooks) repair(counts_.silences, now_us);
}

bool Bno085::has_answered(bool is_answered) {
  if (is_answered) {
    misses_ = 0;
    return true;
  }
  count(counts_.bus_errors);
  ++misses_;
  if (misses_ % kMissesToRecover == 0) needs_bus_recovery_ = true;
  return false;
}

uint8_t Bno085::rotation_report() const {
  return settings_.fusion == Fusion::kNdof ? kRotationVector : kGameRotationVector;
}

uint8_t Bno085::levels() const {
  return static_cast<uint8_t>(accuracy_[0] << 6 | accuracy_[1] << 4 | accuracy_[2] << 2 | accuracy_[3]);
}

}  // namespace bunraku
