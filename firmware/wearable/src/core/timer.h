// A span of time that ends by itself. Safe at the clock's wrap if it is asked at least every 35 minutes.
#pragma once

#include <stdint.h>

namespace bunraku {

class Timer {
 public:
  void start(uint32_t now_us, uint32_t span_us) {
    ends_us_ = now_us + span_us;
    runs_ = true;
  }
  void stop() { runs_ = false; }
  bool is_running(uint32_t now_us) {
    if (runs_ && static_cast<int32_t>(now_us - ends_us_) >= 0) runs_ = false;
    return runs_;
  }

 private:
  uint32_t ends_us_ = 0;
  bool runs_ = false;
};

}  // namespace bunraku
