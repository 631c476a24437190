// Axes turned in quarter turns: which choices are a turn and no mirror, and that turn as a quaternion.
#include "axis_remap.h"

#include "imu.h"

namespace bunraku {

bool is_axis_remap(uint8_t axis_map, uint8_t axis_sign) {
  const uint8_t x = axis_map & 3, y = axis_map >> 2 & 3, z = axis_map >> 4 & 3;
  if ((1 << x | 1 << y | 1 << z) != 7 || axis_map > 0x3F || axis_sign > 7) return false;
  const bool is_odd = (x > y) != ((x > z) != (y > z));
  const bool is_mirrored = ((axis_sign >> 2 ^ axis_sign >> 1 ^ axis_sign) & 1) != 0;
  return is_odd == is_mirrored;
}

// From the rotation matrix, which has a single entry of +1 or -1 in each row: the largest of the four squares is
// 1, 2 or 4.
void AxisTurn::set(uint8_t axis_map, uint8_t axis_sign) {
  int8_t m[3][3] = {};
  for (uint8_t i = 0; i < 3; ++i) {
    m[axis_map >> 2 * i & 3][i] = static_cast<int8_t>((axis_sign >> (2 - i) & 1) != 0 ? -1 : 1);
  }
  const int trace = m[0][0] + m[1][1] + m[2][2];
  const int parts[4][4] = {{1 + trace, m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]},
                           {m[2][1] - m[1][2], 1 + 2 * m[0][0] - trace, m[0][1] + m[1][0], m[0][2] + m[2][0]},
                           {m[0][2] - m[2][0], m[0][1] + m[1][0], 1 + 2 * m[1][1] - trace, m[1][2] + m[2][1]},
                           {m[1][0] - m[0][1], m[0][2] + m[2][0], m[1][2] + m[2][1], 1 + 2 * m[2][2] - trace}};
  uint8_t best = 0;
  for (uint8_t i = 1; i < 4; ++i) {
    if (parts[i][i] > parts[best][best]) best = i;
  }
  const int square = parts[best][best];
  const int unit = square == 4 ? 4096 : square == 2 ? 5793 : 8192;  // 16384 / (2 sqrt(square))
  for (uint8_t i = 0; i < 4; ++i) turn_[i] = static_cast<int16_t>(parts[best][i] * unit);
}

void AxisTurn::apply(int16_t (&q)[4]) const {
  const int32_t w = q[0], x = q[1], y = q[2], z = q[3];
  const int32_t a = turn_[0], b = turn_[1], c = turn_[2], d = turn_[3];
  q[0] = rounded(w * a - x * b - y * c - z * d);
  q[1] = rounded(w * b + x * a + y * d - z * c);
  q[2] = rounded(w * c - x * d + y * a + z * b);
  q[3] = rounded(w * d + x * c - y * b + z * a);
}

int16_t AxisTurn::rounded(int32_t product) {
  const int32_t part = (product + (1 << 13)) >> 14;
  return static_cast<int16_t>(part > INT16_MAX ? INT16_MAX : part < INT16_MIN ? INT16_MIN : part);
}

}  // namespace bunraku
