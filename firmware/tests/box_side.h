// The box's side, for tests of the wearable: packets signed with a key, every field open to be wrong.
#pragma once

#include <vector>

#include "blake2s.h"
#include "wire.h"

namespace bunraku {
namespace fakes {

constexpr uint8_t kKey[wire::kKeyBytes] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
constexpr uint8_t kOtherKey[wire::kKeyBytes] = {1, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};

template <typename Packet>
std::vector<uint8_t> signed_packet(const Packet& packet, const uint8_t (&key)[wire::kKeyBytes] = kKey) {
  std::vector<uint8_t> data(Packet::kSize);
  packet.write(data.data());
  blake2s({key, sizeof key, data.data(), Packet::kSignedBytes}, data.data() + Packet::kSignedBytes,
          wire::kTagBytes);
  return data;
}

inline bool is_signed(const std::vector<uint8_t>& data, const uint8_t (&key)[wire::kKeyBytes] = kKey) {
  if (data.size() <= wire::kTagBytes) return false;
  uint8_t tag[wire::kTagBytes];
  const size_t signed_bytes = data.size() - wire::kTagBytes;
  blake2s({key, sizeof key, data.data(), static_cast<uint16_t>(signed_bytes)}, tag, sizeof tag);
  return is_same_tag(tag, data.data() + signed_bytes, sizeof tag);
}

// One box in one run; knows a wearable by its packets.
struct BoxSide {
  uint32_t device_id = 0x1A2B3C4D;
  uint32_t boot_nonce = 0;
  uint32_t session = 0x5E551011;
  uint32_t sequence = 0;

  template <typename Packet>
  Packet head() {
    Packet packet = {};
    packet.device_id = device_id;
    packet.boot_nonce = boot_nonce;
    packet.session = session;
    packet.sequence = ++sequence;
    return packet;
  }
  wire::Assignment assignment(uint32_t hello_sequence, uint8_t rate_hz = 50) {
    auto packet = head<wire::Assignment>();
    packet.hello_sequence = hello_sequence;
    packet.rate_hz = rate_hz;
    packet.led = wire::kLedOn;
    return packet;
  }
  wire::Heartbeat heartbeat(uint32_t echo_sequence = 0, uint32_t echo_held_us = 0, uint8_t led = wire::kLedOn) {
    auto packet = head<wire::Heartbeat>();
    packet.echo_sequence = echo_sequence;
    packet.echo_held_us = echo_held_us;
    packet.led = led;
    return packet;
  }
  wire::Call call() { return head<wire::Call>(); }
  wire::Restore restore(const uint8_t* imu_id, uint8_t first_offset = 7) {
    auto packet = head<wire::Restore>();
    memcpy(packet.imu_id, imu_id, sizeof packet.imu_id);
    packet.offsets[0] = first_offset;
    packet.offsets[18] = 0xE8, packet.offsets[19] = 0x03;  // radius of the accelerometer: 1000
    packet.offsets[20] = 0xE0, packet.offsets[21] = 0x01;  // magnetometer radius: 480
    return packet;
  }
};

}  // namespace fakes
}  // namespace bunraku
