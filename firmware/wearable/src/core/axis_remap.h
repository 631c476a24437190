// Axes turned in quarter turns, for chips that do not turn their own.
#pragma once

#include <stdint.h>

namespace bunraku {

// An axis remap (imu.h) as the turn from the new axes to the chip's.
class AxisTurn {
 public:
  void set(uint8_t axis_map, uint8_t axis_sign);   // must be a remap, as is_axis_remap() says
  void apply(int16_t (&orientation)[4]) const;     // of the chip's axes before, of the new ones afterwards

 private:
  static int16_t rounded(int32_t product);

  int16_t turn_[4] = {16384, 0, 0, 0};
};

}  // namespace bunraku
