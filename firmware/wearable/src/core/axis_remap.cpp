// Axes turned in quarter turns: which choices are a turn, and no mirror.
#include "imu.h"

namespace bunraku {

bool is_axis_remap(uint8_t axis_map, uint8_t axis_sign) {
  const uint8_t x = axis_map & 3, y = axis_map >> 2 & 3, z = axis_map >> 4 & 3;
  if ((1 << x | 1 << y | 1 << z) != 7 || axis_map > 0x3F || axis_sign > 7) return false;
  const bool is_odd = (x > y) != ((x > z) != (y > z));
  const bool is_mirrored = ((axis_sign >> 2 ^ axis_sign >> 1 ^ axis_sign) & 1) != 0;
  return is_odd == is_mirrored;
}

}  // namespace bunraku
