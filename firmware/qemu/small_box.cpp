// A box small enough for the micro:bit.
#include "small_box.h"

#include <string.h>

#include "blake2s.h"

namespace bunraku {
namespace {

constexpr uint32_t kSession = 0x5E551041;
constexpr uint32_t kBeatUs = 1000000;

}  // namespace

SmallBox::SmallBox(uint32_t device_id, const uint8_t (&key)[wire::kKeyBytes]) : device_id_(device_id) {
  memcpy(key_, key, sizeof key_);
}

void SmallBox::hear(const uint8_t* data, uint16_t count, uint32_t now_us) {
  if (is_authentic<wire::Hello>(data, count)) {
    hello_.read(data);
    is_greeted_ = hello_.wire_hash == wire::kWireHash;
    ++hellos;
  } else if (is_authentic<wire::Reading>(data, count)) {
    wire::Reading reading;
    reading.read(data);
    if (reading.session != kSession || (readings > 0 && reading.sequence <= newest_.sequence)) {
      ++refused;
      return;
    }
    if (readings > 0) lost += reading.sequence - newest_.sequence - 1;
    ++readings;
    newest_ = reading;
    heard_us_ = now_us;
    round_trip = reading.round_trip;
  } else {
    ++refused;
  }
}

uint8_t SmallBox::answer(uint8_t (&packet)[wire::kLargest], uint32_t now_us) {
  if (is_greeted_) {
    is_greeted_ = false;
    return sign(wire::Assignment{device_id_, hello_.boot_nonce, kSession, ++sequence_, hello_.sequence, 0, rate_hz,
                                 wire::kLedSlow},
                packet);
  }
  if (is_silent || readings == 0 || now_us - beat_us_ < kBeatUs) return 0;
  beat_us_ = now_us;
  return sign(wire::Heartbeat{device_id_, hello_.boot_nonce, kSession, ++sequence_, newest_.sequence,
                              now_us - heard_us_, wire::kLedOn},
              packet);
}

template <typename Packet>
bool SmallBox::is_authentic(const uint8_t* data, uint16_t count) const {
  if (count != Packet::kSize || data[3] != Packet::kKind) return false;
  uint8_t tag[wire::kTagBytes];
  blake2s({key_, sizeof key_, data, Packet::kSignedBytes}, tag, sizeof tag);
  return is_same_tag(tag, data + Packet::kSignedBytes, sizeof tag);
}

template <typename Packet>
uint8_t SmallBox::sign(const Packet& packet, uint8_t* data) const {
  packet.write(data);
  blake2s({key_, sizeof key_, data, Packet::kSignedBytes}, data + Packet::kSignedBytes, wire::kTagBytes);
  return Packet::kSize;
}

}  // namespace bunraku
