// USB serial that never waits: what the host has not fetched yet is not added to.
#pragma once

#include "../../core/ports.h"

namespace bunraku {

class UsbSerial final : public SerialPort {
 public:
  void begin();
  bool is_connected() override;
  uint16_t read(uint8_t* data, uint16_t room) override;
  uint16_t write(const uint8_t* data, uint16_t count) override;

 private:
  uint16_t bus_frame_ = 0;
  uint32_t frame_heard_ms_ = 0;
};

}  // namespace bunraku
