// Rotations of the simulated chips, in double precision.
#pragma once

#include <algorithm>
#include <cmath>

#include "path.h"

namespace bunraku {

using Vector = std::array<double, 3>;
constexpr double kPi = 3.14159265358979323846;

inline Quaternion product(const Quaternion& a, const Quaternion& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

inline Quaternion about_z(double radians) { return {std::cos(radians / 2), 0, 0, std::sin(radians / 2)}; }

inline double heading(const Quaternion& q) {  // angle of the x axis, about z
  return std::atan2(2 * (q[0] * q[3] + q[1] * q[2]), 1 - 2 * (q[2] * q[2] + q[3] * q[3]));
}

inline double angle(const Quaternion& a, const Quaternion& b) {
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

}  // namespace bunraku
