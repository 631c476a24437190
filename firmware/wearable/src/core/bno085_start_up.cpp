// The BNO085 from power-on to its reports, and back there after trouble: a question at a time.
#include <string.h>

#include "bno085.h"
#include "saturating.h"
#include "sh2.h"

namespace bunraku {
namespace {

using namespace sh2;

constexpr uint32_t kSearchUs = 1400000;     // longer, and there is no hub
constexpr uint32_t kNextLookUs = 10000;
constexpr uint32_t kFailedLookUs = 250000;
constexpr uint32_t kAnswerUs = 200000;      // longest wait for an answer
constexpr uint32_t kSaveUs = 2000000;       // it writes its flash
constexpr uint32_t kDataUs = 500000;        // from settings to the first report
constexpr uint32_t kBackOffUs = 100000;     // before the first reset; twice as long before each next
constexpr uint8_t kMostTries = 3;
constexpr uint8_t kRepairsBeforeReset = 2, kRepairsBeforeFailed = 6, kMostRepairs = 8;
constexpr uint32_t kRotationEveryUs = 5000, kLinearEveryUs = 10000, kLevelsEveryUs = 200000;
constexpr char kFamily[] = "BNO8";

}  // namespace

void Bno085::search() {
  hub_.forget();
  is_reading_ = is_interrupted_ = is_idle_ = is_asked_ = is_saving_ = false;
  misses_ = tries_ = 0;
  state_ = State::kSearch;
}

void Bno085::keep_looking(uint32_t now_us) {
  state_ = State::kSearch;
  if (now_us - searching_us_ > kSearchUs) has_failed_ = true;
  if (!has_run_) hub_.use(static_cast<uint8_t>(hub_.address() ^ kAddress ^ kOtherAddress));
  pause(has_failed_ ? kFailedLookUs : kNextLookUs, now_us);
}

void Bno085::go(State state, uint32_t now_us) {
  state_ = state;
  is_asked_ = false;
  tries_ = setting_ = 0;
  asked_us_ = now_us;
}

void Bno085::next_question(uint32_t now_us) {
  switch (state_) {
    case State::kAskProduct: return go(has_id_ ? State::kAskFeature : State::kAskSerial, now_us);
    case State::kAskSerial: has_id_ = true; return go(State::kAskCalibration, now_us);
    case State::kAskCalibration: return go(State::kAskFeature, now_us);
    case State::kAskFeature: return go(State::kConfigure, now_us);
    default: return;
  }
}

// Says what is due now. A question without an answer is repeated; one about the hub's flash is given up.
bool Bno085::ask(uint32_t now_us) {
  if (state_ == State::kConfigure) return configure(now_us);
  if (state_ == State::kAwaitData && now_us - asked_us_ > kDataUs) return repair(counts_.silences, now_us), false;
  if (is_saving_ && now_us - save_asked_us_ > kSaveUs) is_saving_ = false, count(counts_.refused_saves);
  if (state_ == State::kRunning && wants_save_) {
    wants_save_ = false;
    is_saving_ = true;
    save_asked_us_ = now_us;
    has_answered(command(kSaveCalibration, 0, 0, 0));
    return true;
  }
  if (state_ < State::kAskProduct || state_ > State::kAskFeature) return false;
  if (is_asked_ && now_us - asked_us_ < kAnswerUs) return false;
  if (tries_ >= kMostTries) {
    count(counts_.unanswered);
    const bool is_vital = state_ == State::kAskProduct || state_ == State::kAskFeature;
    is_vital ? repair(counts_.silences, now_us) : next_question(now_us);
    return false;
  }
  const uint8_t product[kProductRequestBytes] = {kProductRequest, 0};
  const uint8_t feature[kFeatureRequestBytes] = {kFeatureRequest, rotation_report()};
  ++tries_;
  is_asked_ = true;
  asked_us_ = now_us;
  bool is_said = false;
  if (state_ == State::kAskProduct) is_said = say(product, sizeof product);
  if (state_ == State::kAskSerial) is_said = ask_for_record(kSerialNumber);
  if (state_ == State::kAskCalibration) is_said = ask_for_record(kDynamicCalibration);
  if (state_ == State::kAskFeature) is_said = say(feature, sizeof feature);
  if (has_answered(is_said)) return true;
  is_asked_ = false;
  if (state_ == State::kAskProduct) keep_looking(now_us);  // nobody listens either
  return true;
}

// The first word of a record: whether it is there at all.
bool Bno085::ask_for_record(uint16_t record) {
  const uint8_t request[kFrsRequestBytes] = {
      kFrsRequest, 0, 0, 0, static_cast<uint8_t>(record), static_cast<uint8_t>(record >> 8), 1, 0};
  return say(request, sizeof request);
}

// A message for each report and its interval, and one for the calibrations that go on. Other reports are switched
// off: the hub may have been configured otherwise before the board was restarted.
bool Bno085::configure(uint32_t now_us) {
  const bool has_field = settings_.fusion == Fusion::kNdof;
  const struct {
    uint8_t report;
    uint32_t interval_us;
  } features[] = {{kGameRotationVector, has_field ? 0 : kRotationEveryUs},
                  {kRotationVector, has_field ? kRotationEveryUs : 0},
                  {kLinearAcceleration, kLinearEveryUs},
                  {kGyroscope, kLevelsEveryUs},
                  {kMagneticField, has_field ? kLevelsEveryUs : 0}};
  constexpr uint8_t kFeatures = sizeof features / sizeof features[0];
  const bool is_said = setting_ < kFeatures
                           ? set_feature(features[setting_].report, features[setting_].interval_us)
                           : command(kSetCalibration, 1, 1, has_field ? 1 : 0);
  if (!has_answered(is_said)) return true;
  if (++setting_ > kFeatures) go(State::kAwaitData, now_us);
  return true;
}

bool Bno085::set_feature(uint8_t report, uint32_t interval_us) {
  uint8_t message[kFeatureBytes] = {kSetFeature, report};
  for (uint8_t i = 0; i < 4; ++i) message[5 + i] = static_cast<uint8_t>(interval_us >> 8 * i);
  return say(message, sizeof message);
}

bool Bno085::command(uint8_t which, uint8_t accelerometer, uint8_t gyroscope, uint8_t magnetometer) {
  const uint8_t message[kCommandBytes] = {kCommandRequest, ++commands_, which,
                                          accelerometer,   gyroscope,   magnetometer};
  return say(message, sizeof message);
}

bool Bno085::say(const uint8_t* message, uint8_t count) { return hub_.say(kControl, message, count); }

void Bno085::take_answer(const uint8_t* message, uint8_t bytes, uint32_t now_us) {
  switch (message[0]) {
    case kProductResponse:
      if (bytes < kProductResponseBytes || state_ != State::kAskProduct) return;
      memcpy(unique_id_, kFamily, 4);
      memcpy(unique_id_ + 4, message + 4, 8);  // part number and build of its software
      return next_question(now_us);
    case kFrsResponse:
      if (bytes >= kFrsResponseBytes) take_record(message, now_us);
      return;
    case kFeatureResponse:
      if (bytes < kFeatureBytes || state_ != State::kAskFeature || message[1] != rotation_report()) return;
      if (long_value(message + 5) == 0) lose_fusion();
      return next_question(now_us);
    case kCommandResponse:
      if (bytes < kCommandResponseBytes || message[2] != kSaveCalibration || !is_saving_) return;
      is_saving_ = false;
      if (message[5] == 0)
        has_profile_ = true;
      else
        count(counts_.refused_saves);
      return;
    default: return;
  }
}

void Bno085::take_record(const uint8_t* message, uint32_t now_us) {
  const uint8_t status = message[1] & kFrsStatusBits;
  const bool is_there = status == kFrsNoError || status == kFrsRecordRead || status == kFrsBlockRead ||
                        status == kFrsBlockAndRecordRead;
  const uint16_t record = value(message + 12);
  if (status == kFrsBusy) return;  // asked again
  if (state_ == State::kAskSerial && record == kSerialNumber) {
    if (is_there) memcpy(unique_id_ + 12, message + 4, 4);
    return next_question(now_us);
  }
  if (state_ != State::kAskCalibration || record != kDynamicCalibration) return;
  has_profile_ = is_there;
  next_question(now_us);
}

void Bno085::begin_running(uint32_t now_us) {
  if (is_fusion_lost_ && has_run_) ++recoveries_;
  is_fusion_lost_ = is_reset_expected_ = has_failed_ = false;
  has_run_ = true;
  running_us_ = low_us_ = now_us;
  state_ = State::kRunning;
}

// Asked and told again; from the third time on after a reset, later and later.
void Bno085::repair(uint16_t& reason, uint32_t now_us) {
  count(reason);
  if (repairs_ < kMostRepairs) ++repairs_;
  if (repairs_ >= kRepairsBeforeFailed) has_failed_ = true;
  searching_us_ = now_us;
  search();
  if (repairs_ <= kRepairsBeforeReset) return;
  const uint8_t reset = kReset;
  hub_.say(kExecutable, &reset, 1);
  count(counts_.resets);
  is_reset_expected_ = true;
  lose_fusion();
  pause(kResetUs + (kBackOffUs << (repairs_ - kRepairsBeforeReset - 1)), now_us);
}

}  // namespace bunraku
