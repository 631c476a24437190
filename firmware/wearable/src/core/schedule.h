// When the next slot is due, on an absolute grid: late slots are skipped and counted, never run in a burst.
#pragma once

#include <stdint.h>

namespace bunraku {

// Safe where the microsecond clock wraps, and after a stall of any length.
class Schedule {
 public:
  void start(uint32_t now_us, uint32_t period_us) {  // the first slot is now
    next_us_ = now_us;
    period_us_ = period_us;
  }

  // True once for each slot that is due.
  bool is_due(uint32_t now_us) {
    const uint32_t ahead_us = next_us_ - now_us;
    if (ahead_us != 0 && ahead_us <= period_us_) return false;  // the next slot is never further ahead
    const uint32_t missed = (now_us - next_us_) / period_us_;
    skipped_ += missed;
    next_us_ += (missed + 1) * period_us_;
    return true;
  }

  uint32_t next_us() const { return next_us_; }
  uint32_t skipped() const { return skipped_; }  // since power-on

 private:
  uint32_t next_us_ = 0;
  uint32_t period_us_ = 1;
  uint32_t skipped_ = 0;
};

}  // namespace bunraku
