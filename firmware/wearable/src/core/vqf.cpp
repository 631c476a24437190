// VQF, its six-axis part. Symbols and defaults are the paper's: sections 3.2 (inclination), 3.4 (rest and bias).
#include "vqf.h"

#include <string.h>

#include "float_math.h"

namespace bunraku {
namespace {

constexpr float kPi = 3.14159265f;
constexpr float kDegree = kPi / 180;
constexpr float kRoot2 = 1.41421356f;

constexpr float kTauS = 3;                   // of the low-pass on acceleration in the nearly inertial frame
constexpr float kSigmaFirst = 0.5f;          // degrees/s, of the bias at the start
constexpr float kForgettingS = 100;          // in which its variance grows from 0 to 0.1 degrees/s, squared
constexpr float kSigmaMotion = 0.1f, kSigmaRest = 0.03f;  // degrees/s, once the estimate has settled
constexpr float kVerticalShare = 0.0001f;    // how much of the vertical bias motion forgets
constexpr float kLargestBias = 2 * kDegree;  // rad/s
constexpr float kRestS = 1.5f, kRestTauS = 0.5f;
constexpr float kRestRate = 2 * kDegree;     // rad/s from the low-passed rate
constexpr float kRestAcceleration = 0.5f;    // m/s^2 from the low-passed acceleration

constexpr float square(float value) { return value * value; }
constexpr float kFirstVariance = square(100 * kSigmaFirst);

float clipped(float value, float largest) {
  return value > largest ? largest : value < -largest ? -largest : value;
}

// a becomes a b.
void multiply(const float (&a)[4], const float (&b)[4], float (&out)[4]) {
  const float product[4] = {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
                            a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
                            a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
                            a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
  memcpy(out, product, sizeof out);
}

template <uint8_t kCount>
void normalise(float (&v)[kCount]) {
  float sum = 0;
  for (const float part : v) sum += part * part;
  if (sum <= 0) return;
  const float scale = 1 / root(sum);
  for (float& part : v) part *= scale;
}

void matrix_of(const float (&q)[4], float (&r)[9]) {
  const float w = q[0], x = q[1], y = q[2], z = q[3];
  const float all[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                        2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                        2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
  memcpy(r, all, sizeof r);
}

void rotate(const float (&q)[4], const float (&v)[3], float (&out)[3]) {
  float r[9];
  matrix_of(q, r);
  const float turned[3] = {r[0] * v[0] + r[1] * v[1] + r[2] * v[2], r[3] * v[0] + r[4] * v[1] + r[5] * v[2],
                           r[6] * v[0] + r[7] * v[1] + r[8] * v[2]};
  memcpy(out, turned, sizeof out);
}

// c = a b, or a b^T.
void multiply(const float (&a)[9], const float (&b)[9], float (&c)[9], bool is_transposed = false) {
  for (uint8_t i = 0; i < 3; ++i) {
    for (uint8_t j = 0; j < 3; ++j) {
      float sum = 0;
      for (uint8_t k = 0; k < 3; ++k) sum += a[3 * i + k] * (is_transposed ? b[3 * j + k] : b[3 * k + j]);
      c[3 * i + j] = sum;
    }
  }
}

void invert(const float (&m)[9], float (&inverse)[9]) {
  const float a = m[4] * m[8] - m[5] * m[7], b = m[5] * m[6] - m[3] * m[8], c = m[3] * m[7] - m[4] * m[6];
  const float scale = 1 / (m[0] * a + m[1] * b + m[2] * c);
  const float adjugate[9] = {a, m[2] * m[7] - m[1] * m[8], m[1] * m[5] - m[2] * m[4],
                             b, m[0] * m[8] - m[2] * m[6], m[2] * m[3] - m[0] * m[5],
                             c, m[1] * m[6] - m[0] * m[7], m[0] * m[4] - m[1] * m[3]};
  for (uint8_t i = 0; i < 9; ++i) inverse[i] = adjugate[i] * scale;
}

}  // namespace

// Its cut-off is where the step response has the time constant: sqrt(2) / (2 pi tau). Warped as bilinear needs.
template <uint8_t kCount>
void SlowFilter<kCount>::set(float tau_s, float period_s) {
  const float half = kRoot2 / 2 / tau_s * period_s;  // pi f T
  const float g = half + half * half * half / 3;     // its tangent: half is below 0.02
  first_ = 1 / (1 + g * (g + kRoot2));
  second_ = g * first_;
  third_ = g * second_;
  to_average_ = tau_s / period_s;
  reset();
}

template <uint8_t kCount>
void SlowFilter<kCount>::feed(const float (&in)[kCount], float (&out)[kCount]) {
  if (!is_settled_) {
    averaged_ += 1;
    for (uint8_t i = 0; i < kCount; ++i) {
      if (averaged_ <= 1) level_[i] = slope_[i] = 0;
      level_[i] += (in[i] - level_[i]) / averaged_;
      out[i] = level_[i];
    }
    is_settled_ = averaged_ >= to_average_;
    return;
  }
  for (uint8_t i = 0; i < kCount; ++i) {
    const float ahead = in[i] - level_[i];
    const float slope = first_ * slope_[i] + second_ * ahead;
    const float step = second_ * slope_[i] + third_ * ahead;
    out[i] = level_[i] + step;
    slope_[i] = 2 * slope - slope_[i];
    level_[i] += 2 * step;
  }
}

void Vqf::begin(float gyroscope_s, float accelerometer_s) {
  *this = Vqf();
  gyroscope_s_ = gyroscope_s;
  accelerometer_s_ = accelerometer_s;
  rest_gyroscope_.set(kRestTauS, gyroscope_s);
  rest_acceleration_.set(kRestTauS, accelerometer_s);
  acceleration_.set(kTauS, accelerometer_s);
  rotation_.set(kTauS, accelerometer_s);
  rotated_bias_.set(kTauS, accelerometer_s);
  for (uint8_t i = 0; i < 9; i = static_cast<uint8_t>(i + 4)) covariance_[i] = kFirstVariance;
  growth_ = square(0.1f * 100) * accelerometer_s / kForgettingS;
  const float motion = square(100 * kSigmaMotion), rest = square(100 * kSigmaRest);
  motion_weight_ = square(motion) / growth_ + motion;
  vertical_weight_ = motion_weight_ / kVerticalShare;
  rest_weight_ = square(rest) / growth_ + rest;
}

void Vqf::feed_gyroscope(const float (&radians_s)[3]) {
  rest_gyroscope_.feed(radians_s, rest_rate_);
  float deviation = 0;
  bool is_turning = false;
  for (uint8_t i = 0; i < 3; ++i) {
    deviation += square(radians_s[i] - rest_rate_[i]);
    is_turning = is_turning || rest_rate_[i] > kLargestBias || rest_rate_[i] < -kLargestBias;
  }
  if (is_turning || deviation >= square(kRestRate)) rest_s_ = 0, is_at_rest_ = false;

  float rate[3];
  for (uint8_t i = 0; i < 3; ++i) rate[i] = radians_s[i] - bias_[i];
  const float norm = root(square(rate[0]) + square(rate[1]) + square(rate[2]));
  if (norm < 1e-9f) return;
  const float half = norm * gyroscope_s_ / 2;
  const float along = sine(half) / norm;
  const float step[4] = {cosine(half), along * rate[0], along * rate[1], along * rate[2]};
  multiply(gyroscope_q_, step, gyroscope_q_);
  normalise(gyroscope_q_);
}

void Vqf::feed_accelerometer(const float (&m_s2)[3]) {
  if (m_s2[0] == 0 && m_s2[1] == 0 && m_s2[2] == 0) return;
  detect_rest(m_s2);
  float up[3];
  rotate(gyroscope_q_, m_s2, up);
  acceleration_.feed(up, up);
  rotate(accelerometer_q_, up, up);
  normalise(up);
  incline(up);
  estimate_bias(up);
  has_orientation_ = true;
}

void Vqf::detect_rest(const float (&m_s2)[3]) {
  float slow[3];
  rest_acceleration_.feed(m_s2, slow);
  float deviation = 0;
  for (uint8_t i = 0; i < 3; ++i) deviation += square(m_s2[i] - slow[i]);
  if (deviation >= square(kRestAcceleration)) {
    rest_s_ = 0;
    is_at_rest_ = false;
    return;
  }
  rest_s_ += accelerometer_s_;
  if (rest_s_ >= kRestS) is_at_rest_ = true;
}

// The shortest turn that makes the low-passed acceleration vertical.
void Vqf::incline(float (&up)[3]) {
  const float w = up[2] > -1 ? root((up[2] + 1) / 2) : 0;
  float turn[4] = {0, 1, 0, 0};
  if (w > 1e-6f) turn[0] = w, turn[1] = up[1] / 2 / w, turn[2] = -up[0] / 2 / w;
  multiply(turn, accelerometer_q_, accelerometer_q_);
  normalise(accelerometer_q_);
}

// A Kalman filter: at rest the rate is the bias; in motion, the turn that the inclination still needs is the
// horizontal part of its error. `up` as it was before that turn.
void Vqf::estimate_bias(const float (&up)[3]) {
  float q[4], r[9];
  orientation(q);
  matrix_of(q, r);
  float rotated[2];
  for (uint8_t i = 0; i < 2; ++i)
    rotated[i] = r[3 * i] * bias_[0] + r[3 * i + 1] * bias_[1] + r[3 * i + 2] * bias_[2];
  rotation_.feed(r, r);
  rotated_bias_.feed(rotated, rotated);
  for (uint8_t i = 0; i < 9; i = static_cast<uint8_t>(i + 4)) {
    if (covariance_[i] < kFirstVariance) covariance_[i] += growth_;
  }
  float error[3];
  if (is_at_rest_) {
    const float unit[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    for (uint8_t i = 0; i < 3; ++i) error[i] = rest_rate_[i] - bias_[i];
    return correct_bias(unit, error, {rest_weight_, rest_weight_, rest_weight_});
  }
  for (uint8_t i = 0; i < 3; ++i) {
    error[i] = -(r[3 * i] * bias_[0] + r[3 * i + 1] * bias_[1] + r[3 * i + 2] * bias_[2]);
  }
  error[0] += rotated[0] - up[1] / accelerometer_s_;
  error[1] += rotated[1] + up[0] / accelerometer_s_;
  correct_bias(r, error, {motion_weight_, motion_weight_, vertical_weight_});
}

void Vqf::correct_bias(const float (&r)[9], const float (&error)[3], const float (&weight)[3]) {
  float by_r[9], inner[9], inverse[9], gain[9], product[9];
  multiply(covariance_, r, by_r, true);  // P R^T
  multiply(r, by_r, inner);
  for (uint8_t i = 0; i < 3; ++i) inner[4 * i] += weight[i];
  invert(inner, inverse);
  multiply(by_r, inverse, gain);
  for (uint8_t i = 0; i < 3; ++i) {
    float step = 0;
    for (uint8_t j = 0; j < 3; ++j) step += gain[3 * i + j] * clipped(error[j], kLargestBias);
    bias_[i] = clipped(bias_[i] + step, kLargestBias);
  }
  multiply(gain, r, inner);
  multiply(inner, covariance_, product);
  for (uint8_t i = 0; i < 9; ++i) covariance_[i] -= product[i];
}

void Vqf::orientation(float (&q)[4]) const { multiply(accelerometer_q_, gyroscope_q_, q); }

float Vqf::bias_sigma_degrees_s() const {
  float largest = covariance_[0];
  for (uint8_t i = 4; i < 9; i = static_cast<uint8_t>(i + 4)) {
    if (covariance_[i] > largest) largest = covariance_[i];
  }
  return root(largest) / 100;
}

}  // namespace bunraku
