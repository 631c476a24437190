// The simulated BNO085: its bus, its conversation, its fusion.
#include "bno085_model.h"

#include <string.h>

#include <algorithm>

#include "rotation.h"
#include "sh2.h"

namespace bunraku {
namespace {

using namespace sh2;

constexpr size_t kMostWaiting = 20;  // then the oldest reports are lost
constexpr size_t kAdvertisementBytes = 272;
constexpr double kAccelerometerTurn = kPi / 2, kMagnetometerTurn = 2 * kPi / 3;  // for a level
constexpr int kNoise = 5;            // of linear acceleration, 1/256 m/s^2
constexpr uint8_t kUnsolicited = 0x80, kInitialize = 0x04;

void put(std::vector<uint8_t>& to, double value) {
  const long bits = std::clamp(std::lround(value), -32768L, 32767L);
  to.push_back(static_cast<uint8_t>(bits));
  to.push_back(static_cast<uint8_t>(bits >> 8));
}

}  // namespace

Bno085Model::Bno085Model(VirtualClock& clock, uint64_t seed, uint8_t address) : ImuModel(clock, seed, address) {
  power_on();
}

void Bno085Model::power_on() {
  is_powered_ = true;
  is_stuck_ = is_commanded_reset_ = false;
  restart(kStartUpUs);
}

void Bno085Model::restart(uint64_t us) {
  is_up_ = is_frozen_ = is_dumb_ = is_announced_ = has_forgotten_ = false;
  features_ = {};
  waiting_.clear();
  sequence_ = {};
  fetched_ = 0;
  answers_us_ = clock_.now_us() + us;
}

// After a reset it introduces itself on three channels.
void Bno085Model::start_up(uint64_t at_us) {
  is_up_ = true;
  is_commanded_reset_ = false;
  fusion_us_ = at_us;
  turned_ = 0;
  last_turned_ = motion_(at_us);
  first_heading_ = heading(last_turned_);
  newest_ = previous_ = fused(at_us, false);
  ++counts_.fusion_starts;
  waiting_.push_back({kAdvertisements, std::vector<uint8_t>(kAdvertisementBytes, 0x5A)});
  waiting_.push_back({kExecutable, {kResetComplete}});
  std::vector<uint8_t> initialized(kCommandResponseBytes, 0);
  initialized[0] = kCommandResponse;
  initialized[2] = kInitialize | kUnsolicited;
  answer(initialized);
}

void Bno085Model::settle() {
  const uint64_t now_us = clock_.now_us();
  if (!is_powered_ || now_us < answers_us_) return;
  if (!is_up_) start_up(answers_us_);
  if (is_frozen_ || is_dumb_) return;
  for (;;) {
    uint64_t next_us = now_us + 1;
    for (const Feature& feature : features_) {
      if (feature.interval_us != 0) next_us = std::min(next_us, feature.next_us);
    }
    if (next_us > now_us) return;
    report(next_us);
  }
}

// All that is due at a moment, in one cargo behind its time base.
void Bno085Model::report(uint64_t at_us) {
  Cargo cargo{kInput, {kTimeBase, 0, 0, 0, 0}, at_us};
  for (uint8_t which = 0; which < kReports; ++which) {
    Feature& feature = features_[which];
    if (feature.interval_us == 0 || feature.next_us > at_us) continue;
    feature.next_us += feature.interval_us;
    add(cargo.payload, which, at_us);
  }
  if (waiting_.size() >= kMostWaiting) {
    const auto oldest = std::find_if(waiting_.begin() + 1, waiting_.end(),
                                     [](const Cargo& other) { return other.channel == kInput; });
    if (oldest != waiting_.end()) waiting_.erase(oldest);
  }
  waiting_.push_back(cargo);
}

void Bno085Model::add(std::vector<uint8_t>& cargo, uint8_t which, uint64_t at_us) {
  cargo.insert(cargo.end(), {which, features_[which].sequence++, accuracy(which, at_us), 0});
  if (which == kRotationVector || which == kGameRotationVector) {
    const Quaternion q = fused(at_us, which == kRotationVector);
    previous_ = newest_;
    newest_ = q;
    turned_ += angle(motion_(at_us), last_turned_);
    last_turned_ = motion_(at_us);
    for (const double part : {q[1], q[2], q[3], q[0]}) put(cargo, part * 16384);
    if (which == kRotationVector) put(cargo, 0.05 * 4096);
    return;
  }
  for (const double part : {0.0, 0.0, which == kLinearAcceleration ? linear_z(at_us) * 256 : 0.0}) {
    put(cargo, part + static_cast<double>(random_.between(0, 2 * kNoise)) - kNoise);
  }
}

uint8_t Bno085Model::accuracy(uint8_t which, uint64_t at_us) const {
  const double seconds = static_cast<double>(at_us - fusion_us_) * 1e-6;
  const auto level = [&](double progress) {
    return static_cast<uint8_t>(is_saved_ && seconds >= 1 ? 3 : std::clamp(progress, 0.0, 3.0));
  };
  if (which == kGyroscope) return level(seconds);
  if (which == kLinearAcceleration) return level(turned_ / kAccelerometerTurn);
  if (which == kMagneticField) return level(turned_ / kMagnetometerTurn);
  return level(std::min(seconds, turned_ / kAccelerometerTurn));
}

Quaternion Bno085Model::fused(uint64_t at_us, bool has_field) const {
  const double minutes = static_cast<double>(at_us - fusion_us_) * 1e-6 / 60;
  const double degrees = has_field ? magnetic_disturbance_degrees : drift_degrees_minute * minutes;
  return product(about_z(degrees * kPi / 180 - (has_field ? 0 : first_heading_)), motion_(at_us));
}

bool Bno085Model::receive(uint8_t address, uint8_t* data, uint8_t count) {
  if (!is_reached(address)) return false;
  memset(data, 0, count);
  if (is_shy && waiting_.empty()) return spend(1), false;
  if (!waiting_.empty()) {
    Cargo& cargo = waiting_.front();
    if (!is_announced_ && cargo.base_us != 0) {
      const uint64_t ticks = (clock_.now_us() - cargo.base_us) / kTickUs;
      for (size_t i = 0; i < 4; ++i) cargo.payload[1 + i] = static_cast<uint8_t>(ticks >> 8 * i);
    }
    const size_t left = cargo.payload.size() - fetched_;
    const size_t length = left + kHeaderBytes + (is_announced_ ? kContinued : 0u);
    const uint8_t header[kHeaderBytes] = {static_cast<uint8_t>(length), static_cast<uint8_t>(length >> 8),
                                          cargo.channel, sequence_[cargo.channel]};
    std::copy_n(header, std::min<size_t>(count, kHeaderBytes), data);
    is_announced_ = true;
    if (count > kHeaderBytes) {
      const size_t taken = std::min<size_t>(left, count - kHeaderBytes);
      std::copy_n(cargo.payload.begin() + static_cast<long>(fetched_), taken, data + kHeaderBytes);
      fetched_ += taken;
      if (fetched_ == cargo.payload.size()) {
        ++sequence_[cargo.channel];
        waiting_.pop_front();
        fetched_ = 0;
        is_announced_ = false;
      }
    }
  }
  const bool is_data = count > kHeaderBytes + kTimeBaseBytes + kVectorBytes && data[2] == kInput;
  if (strikes(ImuFault::kTornRead, is_data)) data[random_.between(0, count - 1u)] ^= 0x11;
  if (strikes(ImuFault::kFlippedBit, is_data) && is_data) {
    const uint64_t part = random_.between(0, 3);
    data[kHeaderBytes + kTimeBaseBytes + 5 + 2 * part] ^= 0x80;
  }
  if (strikes(ImuFault::kZeroRead, is_data)) memset(data, 0, count);
  spend(1u + count);
  return true;
}

bool Bno085Model::write(uint8_t address, uint8_t reg, const uint8_t* data, uint8_t count) {
  if (!is_reached(address)) return false;
  spend(2u + count);
  settle();
  const bool is_whole = count >= kHeaderBytes && reg == count + 1 && data[0] == 0;
  if (!is_whole || !obey(data[1], data + 3, count - 3u)) ++counts_.illegal_writes;
  return true;
}

// False: not a message that the manual has.
bool Bno085Model::obey(uint8_t channel, const uint8_t* message, size_t count) {
  if (channel == kExecutable && count == 1 && message[0] == kReset) {
    ++counts_.resets;
    restart(kResetUs);
    is_commanded_reset_ = true;
    return true;
  }
  if (channel != kControl) return false;
  if (is_dumb_) return true;
  std::vector<uint8_t> response;
  switch (message[0]) {
    case kProductRequest:
      response = {kProductResponse, 1, 3, 12, 0x4A, 0x9E, 0x98, 0, 0x77, 1, 0, 0, 7, 0, 0, 0};
      answer(response);
      response[4] = 0x4B;  // the hub has several, one of each of its programs
      answer(response);
      return count == kProductRequestBytes;
    case kFrsRequest: answer_record(value(message + 4)); return count == kFrsRequestBytes;
    case kSetFeature: return count == kFeatureBytes && set_feature(message);
    case kFeatureRequest: {
      if (count != kFeatureRequestBytes || message[1] >= kReports) return false;
      response.assign(kFeatureBytes, 0);
      response[0] = kFeatureResponse;
      response[1] = message[1];
      for (size_t i = 0; i < 4; ++i) {
        response[5 + i] = static_cast<uint8_t>(features_[message[1]].interval_us >> 8 * i);
      }
      answer(response);
      return true;
    }
    case kCommandRequest: {
      if (count != kCommandBytes || (message[2] != kSaveCalibration && message[2] != kSetCalibration))
        return false;
      response.assign(kCommandResponseBytes, 0);
      response[0] = kCommandResponse;
      response[2] = message[2];
      response[3] = message[1];
      response[5] = message[2] == kSaveCalibration && refuses_saves ? 1 : 0;
      if (message[2] == kSaveCalibration && !refuses_saves) is_saved_ = true, ++saves_;
      answer(response);
      return true;
    }
    default: return false;
  }
}

bool Bno085Model::set_feature(const uint8_t* message) {
  const uint8_t which = message[1];
  if (which >= kReports) return false;
  const uint32_t interval_us = long_value(message + 5);
  if (interval_us != 0 && interval_us < 2500) return false;  // 400 Hz is the fastest
  if (has_forgotten_ && interval_us != 0) ++counts_.fusion_starts;  // its heading cannot be trusted meanwhile
  has_forgotten_ = has_forgotten_ && interval_us == 0;
  features_[which].interval_us = interval_us;
  features_[which].next_us = clock_.now_us() + interval_us;
  return true;
}

void Bno085Model::answer_record(uint16_t record) {
  const bool is_known = record == kSerialNumber || record == kDynamicCalibration;
  const bool is_there = record == kSerialNumber || (is_known && is_saved_);
  std::vector<uint8_t> response(kFrsResponseBytes, 0);
  response[0] = kFrsResponse;
  response[1] = static_cast<uint8_t>(is_there ? 0x10 | kFrsBlockRead : is_known ? kFrsEmpty : 1);
  if (is_there) std::copy_n(unique_id_.begin(), 4, response.begin() + 4);
  response[12] = static_cast<uint8_t>(record);
  response[13] = static_cast<uint8_t>(record >> 8);
  answer(response);
}

void Bno085Model::strike_states() {
  if (strikes(ImuFault::kBrownOut, true)) power_on();
  if (strikes(ImuFault::kSilentConfig, true)) {
    features_ = {};
    has_forgotten_ = true;
  }
  if (strikes(ImuFault::kFrozen, true)) is_frozen_ = true;
  if (strikes(ImuFault::kFusionError, true)) is_dumb_ = true;
}

Quaternion Bno085Model::newest() {
  settle();
  return newest_;
}

Quaternion Bno085Model::previous() {
  settle();
  return previous_;
}

}  // namespace bunraku
