// The clock of the board: microseconds since power-on.
#pragma once

#include <Arduino.h>

#include "../core/ports.h"

namespace bunraku {

class BoardClock final : public Clock {
 public:
  uint32_t micros() override { return ::micros(); }
};

}  // namespace bunraku
