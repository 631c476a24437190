// USB serial that never waits. Serial.write() would, for up to 70 ms, and availableForWrite() always returns 63,
// so the endpoint's own flags are asked; so are the bus frames, because the core keeps DTR after an unplug.
#include "../board.h"
#ifdef BUNRAKU_SAMD

#include "usb_serial.h"

#include <Arduino.h>

namespace bunraku {
namespace {

constexpr uint8_t kInEndpoint = 3;  // CDC's data endpoint towards the host: the third that the core plugs in
constexpr uint16_t kLargestPiece = 63;  // one less than the endpoint holds: a full one needs a second packet
constexpr uint32_t kUnpluggedMs = 50;  // a live host sends a frame each millisecond

bool endpoint_is_free() {
  const auto& endpoint = USB->DEVICE.DeviceEndpoint[kInEndpoint];
  const bool holds_data = endpoint.EPSTATUS.reg & USB_DEVICE_EPSTATUS_BK1RDY;
  const bool was_fetched = endpoint.EPINTFLAG.reg & USB_DEVICE_EPINTFLAG_TRCPT1;
  return !holds_data || was_fetched;
}

}  // namespace

void UsbSerial::begin() { Serial.begin(115200); }

bool UsbSerial::is_connected() {
  if (!USBDevice.configured()) {  // plugged in again: the core still has the old DTR
    Serial.end();
    return false;
  }
  const uint16_t frame = USB->DEVICE.FNUM.reg;
  const uint32_t now_ms = millis();
  if (frame != bus_frame_) {
    bus_frame_ = frame;
    frame_heard_ms_ = now_ms;
  }
  return Serial.dtr() && now_ms - frame_heard_ms_ < kUnpluggedMs;  // bool(Serial) would wait 10 ms
}

uint16_t UsbSerial::read(uint8_t* data, uint16_t room) {
  uint16_t count = 0;
  while (count < room && Serial.available() > 0) data[count++] = static_cast<uint8_t>(Serial.read());
  return count;
}

uint16_t UsbSerial::write(const uint8_t* data, uint16_t count) {
  if (!endpoint_is_free()) return 0;
  const uint16_t piece = count < kLargestPiece ? count : kLargestPiece;
  Serial.write(data, piece);
  return piece;
}

}  // namespace bunraku

#endif
