// A double tap on the case, told from dancing by the quiet before and after it.
#pragma once

#include <stdint.h>

#include "timer.h"

namespace bunraku {

class Taps {
 public:
  // Linear acceleration at 100 Hz, 1/100 m/s^2. True: a double tap is complete.
  bool feed(const int16_t (&linear)[3], uint32_t now_us);

 private:
  enum class Phase : uint8_t { kRestless, kQuiet, kFirst, kSecond };

  Phase phase_ = Phase::kRestless;
  uint32_t phase_us_ = 0;  // when it began
  uint32_t fed_us_ = 0;
};

}  // namespace bunraku
