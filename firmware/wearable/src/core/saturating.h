// Counters that stop at their end: a wearable that had much trouble must not look as if it had none.
#pragma once

#include <stdint.h>

namespace bunraku {

inline void count(uint16_t& counter) {
  if (counter != 0xFFFF) ++counter;
}

}  // namespace bunraku
