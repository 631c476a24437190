// A double tap on the case, told from dancing by the quiet before and after it.
#pragma once

#include <stdint.h>

namespace bunraku {

class Taps {
 public:
  // Linear acceleration at 100 Hz, 1/100 m/s^2. True: a double tap is complete.
  bool feed(const int16_t (&linear)[3], uint32_t now_us);

 private:
  void begin_burst(uint32_t now_us);
  void end_burst(uint32_t now_us);
  bool rest(uint32_t now_us);

  uint8_t taps_ = 0;         // found so far
  bool is_loud_ = false;     // a burst goes on
  bool may_count_ = false;   // it began at the right moment for a tap
  bool has_spike_ = false;   // and was strong enough
  bool is_settled_ = false;  // it has been quiet for long enough
  uint32_t burst_us_ = 0, quiet_us_ = 0;  // when they began
  uint32_t first_us_ = 0;                 // when the first tap came
  uint32_t fed_us_ = 0;
};

}  // namespace bunraku
