// Orientation from gyroscope and accelerometer: VQF of Laidig and Seel, "VQF: Highly accurate IMU orientation
// estimation with bias estimation and magnetic disturbance rejection" (Information Fusion 91, 2023), its six-axis part
// with both bias estimations, in single precision.
#pragma once

#include <stdint.h>

namespace bunraku {

// Second-order Butterworth low-pass as two integrators: in single precision its slow poles would be lost in the
// coefficients of the direct form. The first `tau` seconds are averaged.
template <uint8_t kCount>
class SlowFilter {
 public:
  void set(float tau_s, float period_s);
  void reset() { averaged_ = 0, is_settled_ = false; }
  void feed(const float (&in)[kCount], float (&out)[kCount]);

 private:
  float first_ = 0, second_ = 0, third_ = 0;  // the coefficients
  float to_average_ = 1;  // samples
  float averaged_ = 0;
  bool is_settled_ = false;
  float slope_[kCount] = {}, level_[kCount] = {};
};

class Vqf {
 public:
  // Seconds between samples; the same as before only begins anew.
  void begin(float gyroscope_s, float accelerometer_s);

  void feed_gyroscope(const float (&radians_s)[3]);
  void feed_accelerometer(const float (&m_s2)[3]);  // all zeros: ignored

  // Out of the sensor into a frame with z up and an arbitrary heading that does not jump; w, x, y, z.
  void orientation(float (&q)[4]) const;

  bool has_orientation() const { return has_orientation_; }  // an acceleration was heard
  bool is_at_rest() const { return is_at_rest_; }  // for 1.5 s
  float bias_sigma_degrees_s() const;  // standard deviation, the largest of the axes

 private:
  void detect_rest(const float (&m_s2)[3]);
  void incline(float (&up)[3]);
  void estimate_bias(const float (&up)[3]);
  void correct_bias(const float (&r)[9], const float (&error)[3], const float (&weight)[3]);

  float gyroscope_s_ = 0, accelerometer_s_ = 0;
  float gyroscope_q_[4] = {1, 0, 0, 0};  // integrated, without any correction
  float accelerometer_q_[4] = {1, 0, 0, 0};  // its inclination corrected
  float bias_[3] = {};  // rad/s
  float covariance_[9] = {};  // the bias's, (0.01 degrees/s)^2
  float growth_ = 0, motion_weight_ = 0, vertical_weight_ = 0, rest_weight_ = 0;
  float rest_s_ = 0;
  float rest_rate_[3] = {};
  bool is_at_rest_ = false;
  bool has_orientation_ = false;
  SlowFilter<3> rest_gyroscope_, rest_acceleration_, acceleration_;
  SlowFilter<9> rotation_;
  SlowFilter<2> rotated_bias_;
};

}  // namespace bunraku
