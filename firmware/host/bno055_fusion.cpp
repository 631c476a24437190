// Inputs of the simulated BNO055: orientation, acceleration, taps, its heading's drift, its calibration.
#include <algorithm>
#include <cmath>

#include "bno055_model.h"
#include "bno055_registers.h"

namespace bunraku {
namespace {

using namespace bno055;
using Vector = std::array<double, 3>;

constexpr double kPi = 3.14159265358979323846;
constexpr double kStandardGravity = 9.81;
constexpr double kTapUs = 20'000;  // the chip's low-pass at 62.5 Hz makes a knock that long
constexpr int kNoise = 2;          // 1/100 m/s^2: 1 mg of noise in 62.5 Hz
constexpr uint8_t kNdof = 0x0C, kImuPlus = 0x08;
constexpr double kAccelerometerTurn = kPi / 2, kMagnetometerTurn = 2 * kPi / 3;  // for a calibration level

Quaternion product(const Quaternion& a, const Quaternion& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

Quaternion about_z(double radians) { return {std::cos(radians / 2), 0, 0, std::sin(radians / 2)}; }

double heading(const Quaternion& q) {  // angle of the x axis, about z
  return std::atan2(2 * (q[0] * q[3] + q[1] * q[2]), 1 - 2 * (q[2] * q[2] + q[3] * q[3]));
}

double angle(const Quaternion& a, const Quaternion& b) {
  double cosine = 0;
  for (size_t i = 0; i < 4; ++i) cosine += a[i] * b[i];
  return 2 * std::acos(std::min(1.0, std::abs(cosine)));
}

// Section 3.4: where each new axis lies among the chip's own, and its sign.
struct Remap {
  Remap(uint8_t map, uint8_t sign) {
    for (size_t i = 0; i < 3; ++i) {
      axis[i] = map >> (2 * i) & 3u;
      direction[i] = (sign >> (2 - i) & 1) != 0 ? -1 : 1;
    }
  }
  Vector of(const Vector& chip) const {
    return {direction[0] * chip[axis[0]], direction[1] * chip[axis[1]], direction[2] * chip[axis[2]]};
  }
  // The remapped axes seen from the chip's: a rotation, or none for a left-handed choice.
  bool rotation(Quaternion& chip_from_new) const {
    double m[3][3] = {};
    for (size_t i = 0; i < 3; ++i) m[axis[i]][i] = direction[i];
    const double trace = m[0][0] + m[1][1] + m[2][2];
    const double determinant = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                               m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                               m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
    const double squares[4] = {1 + trace, 1 + 2 * m[0][0] - trace, 1 + 2 * m[1][1] - trace,
                               1 + 2 * m[2][2] - trace};
    const double parts[4][4] = {{squares[0], m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]},
                                {m[2][1] - m[1][2], squares[1], m[0][1] + m[1][0], m[0][2] + m[2][0]},
                                {m[0][2] - m[2][0], m[0][1] + m[1][0], squares[2], m[1][2] + m[2][1]},
                                {m[1][0] - m[0][1], m[0][2] + m[2][0], m[1][2] + m[2][1], squares[3]}};
    const size_t best = static_cast<size_t>(std::max_element(squares, squares + 4) - squares);
    for (size_t i = 0; i < 4; ++i) chip_from_new[i] = parts[best][i] / (2 * std::sqrt(squares[best]));
    return determinant > 0;
  }
  size_t axis[3];
  double direction[3];
};

void put(uint8_t* at, double value) {
  const long bits = std::clamp(std::lround(value), -32768L, 32767L);
  at[0] = static_cast<uint8_t>(bits);
  at[1] = static_cast<uint8_t>(bits >> 8);
}

double get(const uint8_t* at) { return static_cast<int16_t>(at[0] | at[1] << 8); }

}  // namespace

void Bno055Model::set_orientation(const Quaternion& world_from_chip) {
  motion_ = [world_from_chip](uint64_t) { return world_from_chip; };
}

void Bno055Model::tap(uint64_t at_us, double peak_m_s2) {
  if (taps_.size() >= 16) taps_.pop_front();
  taps_.push_back({at_us, peak_m_s2});
}

double Bno055Model::linear_z(uint64_t at_us) const {
  double sum = 0;
  for (const Tap& knock : taps_) {
    const double since_us = static_cast<double>(at_us) - static_cast<double>(knock.at_us);
    if (since_us >= 0 && since_us < kTapUs) sum += knock.peak_m_s2 * std::sin(kPi * since_us / kTapUs);
  }
  return sum;
}

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
