// The rest of an MKR board: lamp, battery, watchdog, noise.
#pragma once

#include "../../core/ports.h"

namespace bunraku {

class BuiltinLed final : public Led {
 public:
  void begin();
  void set(bool is_on) override;
};

class MkrBoard final : public Board {
 public:
  void begin();
  uint16_t battery_millivolts() override;
  void noise(uint8_t* data, uint8_t count) override;
  void feed_watchdog() override;
  void restart() override;
  bool was_reset_by_watchdog() override;
  uint32_t serial_number() override;

 private:
  static void start_watchdog();
};

}  // namespace bunraku
