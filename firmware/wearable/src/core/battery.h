// The LiPo cell: from millivolts to percent, smoothed.
#pragma once

#include <stdint.h>

namespace bunraku {

class Battery {
 public:
  void measure(uint16_t millivolts);  // once a second; 0: unknown
  uint16_t millivolts() const { return static_cast<uint16_t>(smoothed_ / kSmoothing); }
  uint8_t percent() const;  // 255: unknown
  bool is_low() const { return is_low_; }  // from below 15 % until above 20 %

 private:
  static constexpr uint8_t kSmoothing = 8;  // measurements
  uint32_t smoothed_ = 0;                   // millivolts * kSmoothing; 0: unknown
  bool is_low_ = false;
};

}  // namespace bunraku
