// The lamp: what it shows in each state, as a function of time.
#pragma once

#include <stdint.h>

#include "status.h"

namespace bunraku {

struct LightCues {
  State state;
  uint8_t box_led;  // wire::Led, counts while linked
  bool is_saving, is_strobing, has_imu_failed, is_battery_low;
};

bool is_lit(const LightCues& cues, uint32_t now_ms);

}  // namespace bunraku
