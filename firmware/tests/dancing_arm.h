// Orientations for the tests of drivers: an arm that dances, and degrees between two of them.
#pragma once

#include <algorithm>
#include <cmath>

#include "path.h"

namespace bunraku {

constexpr double kDegree = 3.14159265358979323846 / 180;

inline Quaternion turned(double degrees, double x, double y, double z) {
  const double length = std::sqrt(x * x + y * y + z * z), half = degrees * kDegree / 2;
  return {std::cos(half), std::sin(half) * x / length, std::sin(half) * y / length, std::sin(half) * z / length};
}

inline double degrees_between(const Quaternion& a, const Quaternion& b) {
  double dot = 0, norms = 0;
  for (size_t i = 0; i < 4; ++i) dot += a[i] * b[i];
  for (const Quaternion& q : {a, b}) norms += std::log(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  return 2 * std::acos(std::min(1.0, std::abs(dot) / std::exp(norms / 2))) / kDegree;
}

inline Quaternion quaternion(const int16_t (&q)[4]) {
  return {q[0] / 16384.0, q[1] / 16384.0, q[2] / 16384.0, q[3] / 16384.0};
}

// An arm that dances: up to about 500 degrees/s about changing axes.
inline Quaternion dance(uint64_t at_us) {
  const double t = static_cast<double>(at_us) * 1e-6;
  return turned(120 * std::sin(4.1 * t) + 20 * std::sin(1.3 * t), std::cos(0.7 * t), std::sin(0.9 * t), 0.6);
}

}  // namespace bunraku
