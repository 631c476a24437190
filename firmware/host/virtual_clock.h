// Time that passes only when the simulation says so; starts anywhere, so that a wrap can be tested.
#pragma once

#include <stdint.h>

#include "ports.h"

namespace bunraku {

class VirtualClock final : public Clock {
 public:
  explicit VirtualClock(uint64_t start_us = 0) : now_us_(start_us) {}

  uint32_t micros() override { return static_cast<uint32_t>(now_us_); }  // what the board sees: it wraps
  uint64_t now_us() const { return now_us_; }  // what the simulation sees: it does not
  void advance(uint64_t us) { now_us_ += us; }
  void advance_to(uint64_t us) {  // never backwards
    if (us > now_us_) now_us_ = us;
  }

 private:
  uint64_t now_us_;
};

}  // namespace bunraku
