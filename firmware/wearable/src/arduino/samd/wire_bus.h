// The I2C bus of an MKR board over Wire, guarded against a chip that holds a line.
#pragma once

#include <Arduino.h>

#include "../../core/ports.h"

namespace bunraku {

class WireBus final : public I2cBus {
 public:
  void begin();
  bool write(uint8_t address, uint8_t reg, const uint8_t* data, uint8_t count) override;
  bool read(uint8_t address, uint8_t reg, uint8_t* data, uint8_t count) override;
  bool receive(uint8_t address, uint8_t* data, uint8_t count) override;
  void recover() override;

 private:
  static bool is_free();
  static void limit_waits();
  static void pull(pin_size_t line, bool is_low);
};

}  // namespace bunraku
