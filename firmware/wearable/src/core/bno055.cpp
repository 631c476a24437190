// The driver's public functions, and its work while fusion runs: reads, watches the chip, refuses nonsense.
#include "bno055.h"

#include <string.h>

#include "bno055_registers.h"
#include "imu_profile.h"
#include "saturating.h"

namespace bunraku {
namespace {

using namespace bno055;

constexpr uint32_t kHealthUs = 1000000;
constexpr uint32_t kPollUs = 10000;             // the chip's output rate
constexpr uint32_t kStableUs = 10000000;        // after running this long, earlier repairs are forgotten
constexpr uint32_t kSlowestSampleUs = 100000;   // a longer gap is a pause, not a rate
constexpr uint32_t kBusKeptFreeUs = 3700;       // before a sample: the longest other transaction is 3.4 ms
constexpr uint32_t kSampleLateUs = 5000;        // latest time of a sample after its slot
constexpr uint8_t kMostMisses = 8;              // bus errors in a row, then the chip is searched for
constexpr uint8_t kMostUnusable = 25;           // readings in a row without an orientation: 0.5 s
constexpr uint16_t kDoubtUnchanged = 3;         // its noise alone usually changes a reading sooner: a look
constexpr uint16_t kMostUnchanged = 500;        // and always much sooner
constexpr int16_t kLargestAcceleration = 6000;  // 1/100 m/s^2: at 4 g nothing larger is measured
constexpr uint8_t kReadingBytes = 14;           // quaternion and linear acceleration

}  // namespace

void Bno055::start(const ImuSettings& settings, uint32_t now_us) {
  is_crystal_new_ = has_run_ && settings.has_crystal != settings_.has_crystal;
  settings_ = settings;
  if (!is_axis_remap(settings.axis_map, settings.axis_sign)) {
    settings_.axis_map = kAxisMapPlain;
    settings_.axis_sign = kAxisSignPlain;
  }
  is_cold_ = true;
  has_failed_ = is_fusion_expected_ = false;
  repairs_ = 0;
  search(now_us);
}

void Bno055::step(uint32_t now_us) {
  if (state_ == State::kOff || is_pausing(now_us)) return;
  if (needs_bus_recovery_) {
    needs_bus_recovery_ = false;
    count(counts_.bus_recoveries);
    return bus_.recover();
  }
  if (misses_ >= kMostMisses && state_ > State::kIdentify) search(now_us);
  state_ == State::kRunning ? run(now_us) : advance(now_us);
}

bool Bno055::sample(uint32_t now_us, Sample& out) {
  if (state_ != State::kRunning) return false;
  const uint32_t since_us = now_us - sampled_us_;
  sample_interval_us_ = since_us <= kSlowestSampleUs ? since_us : 0;
  sampled_us_ = now_us;
  uint8_t bytes[kReadingBytes];
  if (!read(kQuaternion, bytes, kReadingBytes)) return false;
  for (uint8_t i = 0; i < 4; ++i) out.orientation[i] = value(bytes + 2 * i);
  out.measured_us = now_us;
  out.calibration = calibration_;
  const ImuGate::Verdict verdict = gate_.admit(out.orientation, now_us);
  take_acceleration(bytes + 8, now_us);
  weigh(verdict);
  look_for_frozen(bytes);
  return is_believed(verdict);
}

bool Bno055::acceleration(int16_t (&linear)[3]) {
  memcpy(linear, linear_, sizeof linear);
  const bool is_new = is_linear_new_;
  is_linear_new_ = false;
  return is_new;
}

bool Bno055::use_profile(const uint8_t* offsets22) {
  const bool is_same = is_profile_known_ && memcmp(profile_, offsets22, kOffsetBytes) == 0;
  if (is_same) return true;
  if (sound_profile_bytes(offsets22) == 0) return count(counts_.refused_profiles), false;
  memcpy(profile_, offsets22, kOffsetBytes);
  is_profile_known_ = wants_restore_ = true;
  return true;
}

void Bno055::save_profile() {
  is_profile_ready_ = false;
  wants_save_ = state_ == State::kRunning;
}

bool Bno055::profile_ready(uint8_t* offsets22) {
  if (!is_profile_ready_) return false;
  memcpy(offsets22, profile_, kOffsetBytes);
  is_profile_ready_ = false;
  return true;
}

void Bno055::run(uint32_t now_us) {
  if (wants_save_) return enter_config_for(Errand::kSave);
  if (wants_restore_) return enter_config_for(Errand::kRestore);
  if (is_sample_near(now_us)) return;
  if (is_suspicious_ || now_us - checked_us_ >= kHealthUs) return check_health(now_us);
  if (now_us - polled_us_ >= kPollUs) poll_acceleration(now_us);
}

// Samples come at a steady rate: the bus is left free for the next one.
bool Bno055::is_sample_near(uint32_t now_us) const {
  const uint32_t since_us = now_us - sampled_us_;
  return sample_interval_us_ != 0 && since_us + kBusKeptFreeUs > sample_interval_us_ &&
         since_us < sample_interval_us_ + kSampleLateUs;
}

// Calibration, status and all that was set, in one look. Doubts are settled by a new search, which keeps
// fusion if it runs as told after all.
void Bno055::check_health(uint32_t now_us) {
  uint8_t bytes[kAxisSign - kCalibration + 1];
  if (!read(kCalibration, bytes, sizeof bytes)) return;
  checked_us_ = now_us;
  is_suspicious_ = false;
  const bool is_fusing = bytes[kSystemStatus - kCalibration] == kStatusFusion;
  if (!is_fusing || !is_as_told(bytes + (kUnits - kCalibration), static_cast<uint8_t>(settings_.fusion))) {
    return search(now_us);
  }
  take_calibration(bytes[0]);
  if (now_us - running_us_ >= kStableUs) repairs_ = 0;
}

void Bno055::take_calibration(uint8_t calibration) {
  calibration_ = calibration;
  const uint8_t needed = settings_.fusion == Fusion::kNdof ? 0x3F : 0x3C;
  if ((calibration & needed) != needed) {
    calibrated_looks_ = 0;
  } else if (calibrated_looks_ < 2) {
    ++calibrated_looks_;
  }
}

void Bno055::poll_acceleration(uint32_t now_us) {
  uint8_t bytes[6];
  polled_us_ = now_us;
  if (read(kLinearAcceleration, bytes, sizeof bytes)) take_acceleration(bytes, now_us);
}

void Bno055::take_acceleration(const uint8_t* bytes, uint32_t now_us) {
  polled_us_ = now_us;
  int16_t linear[3];
  for (uint8_t i = 0; i < 3; ++i) {
    linear[i] = value(bytes + 2 * i);
    if (linear[i] > kLargestAcceleration || linear[i] < -kLargestAcceleration) return;
  }
  memcpy(linear_, linear, sizeof linear_);
  is_linear_new_ = true;
}

// Counts refused readings, and asks the chip for its state when readings are invalid.
void Bno055::weigh(ImuGate::Verdict verdict) {
  using Verdict = ImuGate::Verdict;
  if (verdict == Verdict::kRelocated) count(counts_.relocated);
  if (verdict == Verdict::kRate) count(counts_.rate);
  if (verdict == Verdict::kTorn) count(counts_.torn);
  const bool is_unusable = verdict == Verdict::kZero || verdict == Verdict::kNorm;
  unusable_ = is_unusable ? static_cast<uint8_t>(unusable_ + 1) : 0;
  if (!is_unusable) return;
  count(verdict == Verdict::kZero ? counts_.zero : counts_.norm);
  is_suspicious_ = true;
  if (unusable_ >= kMostUnusable) repair(counts_.frozen);
}

void Bno055::look_for_frozen(const uint8_t* bytes) {
  const bool is_unchanged = memcmp(bytes, seen_, kReadingBytes) == 0;
  unchanged_ = is_unchanged ? static_cast<uint16_t>(unchanged_ + 1) : 0;
  memcpy(seen_, bytes, kReadingBytes);
  if (unchanged_ == kDoubtUnchanged) is_suspicious_ = true;
  if (unchanged_ >= kMostUnchanged) repair(counts_.frozen);
}

}  // namespace bunraku
