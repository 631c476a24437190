// USB serial of an ESP32-S3 board, by its own USB unit or TinyUSB: the core chooses, the calls are the same.
#pragma once

#include "../../core/ports.h"

namespace bunraku {

class UsbCable final : public SerialPort {
 public:
  void begin();
  bool is_connected() override;
  uint16_t read(uint8_t* data, uint16_t room) override;
  uint16_t write(const uint8_t* data, uint16_t count) override;
};

}  // namespace bunraku
