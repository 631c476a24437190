// The I2C bus of an ESP32-S3 board over Wire, whose transactions end after 10 ms whatever hangs.
#pragma once

#include "../../core/ports.h"

namespace bunraku {

class Esp32Bus final : public I2cBus {
 public:
  void begin();
  bool write(uint8_t address, uint8_t reg, const uint8_t* data, uint8_t count) override;
  bool read(uint8_t address, uint8_t reg, uint8_t* data, uint8_t count) override;
  bool receive(uint8_t address, uint8_t* data, uint8_t count) override;
  void recover() override;

 private:
  static bool take(uint8_t address, uint8_t* data, uint8_t count);
};

}  // namespace bunraku
