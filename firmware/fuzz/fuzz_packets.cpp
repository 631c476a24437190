// Feeds arbitrary packets, by Wi-Fi or cable, in any order and at any time, to the pairing. The input is a
// script of operations; some of them sign a packet with the right key, so that fuzzing gets past the tag.
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "blake2s.h"
#include "pairing.h"

using namespace bunraku;

namespace {

constexpr uint32_t kDeviceId = 0x1A2B3C4D, kBootNonce = 0xDEADBEEF;  // the golden packets' own
constexpr uint8_t kKey[wire::kKeyBytes] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
constexpr Condition kCondition = {87, wire::kHasProfile, 1, 2, {0x50, 0x51, 0x52, 0x53}};
constexpr uint8_t kOffsets[22] = {1, 2, 3};
constexpr uint8_t kMostAtOnce = 8;  // packets for one moment

void require(bool is_right) {
  if (!is_right) abort();
}

// The input, read from front to back; zeros after its end.
class Script {
 public:
  Script(const uint8_t* data, size_t count) : data_(data), left_(count) {}
  bool goes_on() const { return left_ > 0; }
  uint8_t byte() {
    if (left_ == 0) return 0;
    --left_;
    return *data_++;
  }
  void fill(uint8_t* to, size_t count) {
    for (size_t i = 0; i < count; ++i) to[i] = byte();
  }

 private:
  const uint8_t* data_;
  size_t left_;
};

bool is_signed(const uint8_t* packet, uint8_t count) {
  if (count <= wire::kTagBytes) return false;
  const uint8_t signed_bytes = static_cast<uint8_t>(count - wire::kTagBytes);
  uint8_t tag[wire::kTagBytes];
  blake2s({kKey, sizeof kKey, packet, signed_bytes}, tag, sizeof tag);
  return memcmp(tag, packet + signed_bytes, sizeof tag) == 0;
}

void receive_raw(Pairing& pairing, Script& script, const Way& from, uint32_t now_us) {
  uint8_t packet[128];
  const uint8_t count = static_cast<uint8_t>(script.byte() % sizeof packet);
  script.fill(packet, count);
  const bool was_linked = pairing.is_linked();
  const uint32_t session = pairing.session();
  const Received received = pairing.receive(packet, count, from, kCondition, now_us);
  if (is_signed(packet, count)) return;
  require(received == Received::kNothing);
  require(pairing.is_linked() == was_linked && pairing.session() == session);
}

void receive_signed(Pairing& pairing, Script& script, const Way& from, uint32_t now_us) {
  constexpr uint8_t kSizes[] = {wire::Hello::kSize,     wire::Assignment::kSize, wire::Reading::kSize,
                                wire::Heartbeat::kSize, wire::Call::kSize,       wire::Profile::kSize,
                                wire::Restore::kSize};
  const uint8_t kind = script.byte() % sizeof kSizes;
  const uint8_t signed_bytes = static_cast<uint8_t>(kSizes[kind] - wire::kTagBytes);
  uint8_t packet[wire::kLargest] = {};
  wire::Call head = {kDeviceId, kBootNonce, 0, 0};
  head.write(packet);
  packet[3] = static_cast<uint8_t>(kind + 1);
  constexpr uint8_t kSignature = 12;  // magic, version, kind, device id, boot nonce
  script.fill(packet + kSignature, static_cast<size_t>(signed_bytes - kSignature));
  blake2s({kKey, sizeof kKey, packet, signed_bytes}, packet + signed_bytes, wire::kTagBytes);
  const Received received = pairing.receive(packet, kSizes[kind], from, kCondition, now_us);
  const bool is_from_a_box = kind != 0 && kind != 2 && kind != 5;
  require(is_from_a_box || received == Received::kNothing);
}

void send_all(Pairing& pairing, uint32_t now_us) {
  uint8_t packet[wire::kLargest];
  Way to;
  uint8_t sent = 0;
  while (const uint8_t count = pairing.next(kCondition, now_us, packet, to)) {
    require(count <= sizeof packet && to.lane != Lane::kNone);
    require(++sent <= kMostAtOnce);
  }
}

void send_reading(Pairing& pairing, uint32_t now_us) {
  uint8_t packet[wire::kLargest];
  Way to;
  const Sample sample = {{16384, 0, 0, 0}, now_us, 0x3F};
  const uint8_t count = pairing.reading(sample, kCondition, now_us, packet, to);
  require(count == (pairing.is_linked() ? wire::Reading::kSize : 0));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t count) {
  Script script(data, count);
  Pairing pairing;
  pairing.begin(kDeviceId, kKey, kBootNonce);
  uint32_t now_us = 0xFFF00000;  // the clock wraps after a second
  while (script.goes_on()) {
    const uint8_t operation = script.byte();
    Way from;
    from.lane = operation & 0x80 ? Lane::kCable : Lane::kWifi;
    from.address = {0x0104A8C0, 9750};
    switch (operation & 0x07) {
      case 0: now_us += script.byte() * 20000u; break;
      case 1: receive_raw(pairing, script, from, now_us); break;
      case 2:
      case 3: receive_signed(pairing, script, from, now_us); break;
      case 4: send_all(pairing, now_us); break;
      case 5: send_reading(pairing, now_us); break;
      case 6: pairing.set_lane(from.lane, script.byte() & 1); break;
      default: pairing.announce_profile(kOffsets); break;
    }
  }
  return 0;
}
