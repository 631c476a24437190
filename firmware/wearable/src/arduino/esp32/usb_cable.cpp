// USB serial of an ESP32-S3 board. It writes no more than there is room for: the Arduino core would wait for room.
#include "../board.h"
#ifdef BUNRAKU_ESP32

#include <Arduino.h>

#include "usb_cable.h"

namespace bunraku {
namespace {

constexpr uint32_t kLongestWaitMs = 2;  // for the core's own lock; with 0 TinyUSB's would write nothing at all

}  // namespace

void UsbCable::begin() {
  Serial.begin(115200);
  Serial.setTxTimeoutMs(kLongestWaitMs);
}

bool UsbCable::is_connected() { return static_cast<bool>(Serial); }

uint16_t UsbCable::read(uint8_t* data, uint16_t room) {
  uint16_t count = 0;
  while (count < room && Serial.available() > 0) data[count++] = static_cast<uint8_t>(Serial.read());
  return count;
}

uint16_t UsbCable::write(const uint8_t* data, uint16_t count) {
  const int room = Serial.availableForWrite();
  if (room <= 0) return 0;
  const uint16_t piece = count < room ? count : static_cast<uint16_t>(room);
  return static_cast<uint16_t>(Serial.write(data, piece));
}

}  // namespace bunraku

#endif
