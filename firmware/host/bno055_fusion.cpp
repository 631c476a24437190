// Inputs of the simulated BNO055: orientation, acceleration, taps, its heading's drift, its calibration.
#include <algorithm>
#include <cmath>

#include "bno055_model.h"
#include "bno055_registers.h"
#include "rotation.h"

namespace bunraku {
namespace {

using namespace bno055;
constexpr double kStandardGravity = 9.81;
constexpr int kNoise = 2;          // 1/100 m/s^2: 1 mg of noise in 62.5 Hz
constexpr uint8_t kNdof = 0x0C, kImuPlus = 0x08;
constexpr double kAccelerometerTurn = kPi / 2, kMagnetometerTurn = 2 * kPi / 3;  // for a calibration level

void put(uint8_t* at, double value) {
  const long bits = std::clamp(std::lround(value), -32768L, 32767L);
  at[0] = static_cast<uint8_t>(bits);
  at[1] = static_cast<uint8_t>(bits >> 8);
}

double get(const uint8_t* at) { return static_cast<int16_t>(at[0] | at[1] << 8); }

}  // namespace

void Bno055Model::start_fusion(uint64_t at_us) {
  const uint8_t* radius = &registers_[kOffsets + 20];
  const int magnetometer_radius = radius[0] | radius[1] << 8;
  if (is_radius_written_ && (magnetometer_radius < 144 || magnetometer_radius > 1280)) {
    registers_[kSystemError] = kErrorConfiguration;
  }
  Quaternion ignored;
  if (!Remap(registers_[kAxisMap], registers_[kAxisSign]).rotation(ignored)) {
    ++counts_.illegal_writes;
    registers_[kAxisMap] = kAxisMapPlain;
    registers_[kAxisSign] = kAxisSignPlain;
  }
  ++counts_.fusion_starts;
  fusion_us_ = at_us;
  updates_ = 0;
  turned_ = 0;
  is_frozen_ = false;
  newest_ = previous_ = Output{};
  first_heading_ = 0;
  first_heading_ = heading(fused(at_us));
  last_learnt_ = fused(at_us);
}

// Into CONFIG mode: the outputs are zero; what was learnt can be read as offsets.
void Bno055Model::stop_fusion() {
  const uint8_t learnt = calibration();
  if (mode_ != kConfigMode && (learnt & 0x3C) == 0x3C) {
    has_learnt_ = true;
    for (size_t i = 0; i < 18; i += 2) put(&registers_[kOffsets + i], unique_id_[i / 2] - 128);
    const bool has_field = mode_ == kNdof && (learnt & 3) == 3;
    put(&registers_[kOffsets + 18], 1000);
    put(&registers_[kOffsets + 20], has_field ? 480 + unique_id_[15] : 0);  // 0 is what is seen in the field
    is_radius_written_ = false;
  }
  if (registers_[kSystemError] == kErrorConfiguration) registers_[kSystemError] = 0;
  newest_ = previous_ = Output{};
}

void Bno055Model::fuse(uint64_t now_us) {
  if (mode_ == kConfigMode || registers_[kSystemError] != 0 || is_frozen_) return;
  const uint64_t updates = (now_us - fusion_us_) / kUpdateUs;
  if (updates == updates_) return;
  previous_ = updates == updates_ + 1 ? newest_ : output(fusion_us_ + (updates - 1) * kUpdateUs);
  newest_ = output(fusion_us_ + updates * kUpdateUs);
  updates_ = updates;
  learn(fused(fusion_us_ + updates * kUpdateUs));
}

void Bno055Model::learn(const Quaternion& orientation) {
  turned_ += angle(orientation, last_learnt_);
  last_learnt_ = orientation;
}

uint8_t Bno055Model::calibration() const {
  if (mode_ == kConfigMode || updates_ == 0) return 0;
  const double seconds = static_cast<double>(updates_ * kUpdateUs) * 1e-6;
  const auto level = [&](double progress) {
    return static_cast<unsigned>(has_learnt_ && seconds >= 1 ? 3 : std::clamp(progress, 0.0, 3.0));
  };
  const unsigned gyroscope = level(seconds), accelerometer = level(turned_ / kAccelerometerTurn);
  if (mode_ == kImuPlus) return static_cast<uint8_t>(gyroscope << 4 | accelerometer << 2);
  const unsigned magnetometer = level(turned_ / kMagnetometerTurn);
  const unsigned system = std::min({gyroscope, accelerometer, magnetometer});
  return static_cast<uint8_t>(system << 6 | gyroscope << 4 | accelerometer << 2 | magnetometer);
}

// Orientation of the remapped axes as fusion believes it: IMUPLUS starts at heading 0 and creeps.
Quaternion Bno055Model::fused(uint64_t at_us) const {
  Quaternion chip_from_new;
  Remap(registers_[kAxisMap], registers_[kAxisSign]).rotation(chip_from_new);
  const Quaternion orientation = product(motion_(at_us), chip_from_new);
  const double minutes = static_cast<double>(at_us - fusion_us_) * 1e-6 / 60;
  const double degrees = mode_ == kImuPlus ? drift_degrees_minute * minutes : magnetic_disturbance_degrees;
  const double turn = degrees * kPi / 180 - (mode_ == kImuPlus ? first_heading_ : 0);
  return product(about_z(turn), orientation);
}

Bno055Model::Output Bno055Model::output(uint64_t at_us) {
  Output out{};
  const Quaternion q = fused(at_us);
  for (size_t i = 0; i < 4; ++i) put(out.bytes + 2 * i, q[i] * 16384);
  const Vector linear = Remap(registers_[kAxisMap], registers_[kAxisSign]).of({0, 0, linear_z(at_us)});
  const Vector up = {2 * (q[1] * q[3] - q[0] * q[2]), 2 * (q[2] * q[3] + q[0] * q[1]),
                     1 - 2 * (q[1] * q[1] + q[2] * q[2])};
  for (size_t i = 0; i < 3; ++i) {
    const double noise = static_cast<double>(random_.between(0, 2 * kNoise)) - kNoise;
    put(out.bytes + kLinearAcceleration - kQuaternion + 2 * i, linear[i] * 100 + noise);
    put(out.bytes + kGravity - kQuaternion + 2 * i, up[i] * kStandardGravity * 100);
  }
  out.bytes[kTemperature - kQuaternion] = 27;
  return out;
}

Quaternion Bno055Model::newest() {
  settle();
  return {get(newest_.bytes) / 16384, get(newest_.bytes + 2) / 16384, get(newest_.bytes + 4) / 16384,
          get(newest_.bytes + 6) / 16384};
}

Quaternion Bno055Model::previous() {
  settle();
  return {get(previous_.bytes) / 16384, get(previous_.bytes + 2) / 16384, get(previous_.bytes + 4) / 16384,
          get(previous_.bytes + 6) / 16384};
}

}  // namespace bunraku
