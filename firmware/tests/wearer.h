// A wearable's pairing on invented times: what it says is kept, and a box says what a test wants it to hear.
#pragma once

#include <doctest/doctest.h>

#include <vector>

#include "box_side.h"
#include "fakes.h"
#include "pairing.h"
#include "second.h"

namespace bunraku {

constexpr uint32_t kBoot = 0xB0071234;
inline const Way kBoxOnWifi = {Lane::kWifi, false, {0xC0A80401, 9750}};

struct Sent {
  uint32_t at_us;
  Way to;
  fakes::Bytes data;
  uint8_t kind() const { return data[3]; }
  template <typename Packet>
  Packet as() const {
    Packet packet;
    packet.read(data.data());
    return packet;
  }
};

// A wearable's pairing with a clock; `wait` runs it in steps of a millisecond and keeps what it says.
struct Wearer {
  Pairing pairing;
  Condition condition = {};
  fakes::BoxSide box;
  uint32_t now_us;
  std::vector<Sent> sent;

  explicit Wearer(uint32_t start_us = 1000) : now_us(start_us) {
    condition.battery = 77;
    condition.flags = 0;
    for (uint8_t i = 0; i < 16; ++i) condition.imu_id[i] = static_cast<uint8_t>(0x50 + i);
    box.boot_nonce = kBoot;
    pairing.begin(box.device_id, fakes::kKey, kBoot);
  }
  void wait(uint32_t us) {
    for (const uint32_t until_us = now_us + us; now_us != until_us; now_us += 1000) speak();
  }
  void speak() {
    uint8_t packet[wire::kLargest];
    Way to;
    int packets = 0;
    while (const uint8_t count = pairing.next(condition, now_us, packet, to)) {
      sent.push_back({now_us, to, fakes::Bytes(packet, packet + count)});
      REQUIRE(++packets <= 4);
    }
  }
  std::vector<Sent> of(uint8_t kind, Lane lane) const {
    std::vector<Sent> found;
    for (const Sent& each : sent)
      if (each.kind() == kind && each.to.lane == lane) found.push_back(each);
    return found;
  }
  std::vector<Sent> hellos(Lane lane) const { return of(wire::Hello::kKind, lane); }
  uint32_t newest_hello() const {
    uint32_t newest = 0;
    for (const Sent& each : sent)
      if (each.kind() == wire::Hello::kKind) newest = each.as<wire::Hello>().sequence;
    return newest;
  }
  Received hear(const fakes::Bytes& data, const Way& from = kBoxOnWifi) {
    return pairing.receive(data.data(), static_cast<uint16_t>(data.size()), from, condition, now_us);
  }
  template <typename Packet>
  Received hear(const Packet& packet, const Way& from = kBoxOnWifi) {
    return hear(fakes::signed_packet(packet), from);
  }
  void link(const Way& from = kBoxOnWifi) {
    pairing.set_lane(from.lane, true);
    wait(1000);
    REQUIRE(hear(box.assignment(newest_hello()), from) == Received::kAssignment);
    sent.clear();
  }
  wire::Reading read(Way* went_to = nullptr) {
    const Sample sample = {{16384, 0, 0, 0}, now_us, 0x3C};
    uint8_t packet[wire::kLargest];
    Way to;
    const uint8_t count = pairing.reading(sample, condition, now_us, packet, to);
    REQUIRE(count == wire::Reading::kSize);
    CHECK(fakes::is_signed(fakes::Bytes(packet, packet + count)));
    if (went_to != nullptr) *went_to = to;
    wire::Reading reading;
    reading.read(packet);
    return reading;
  }
  bool streams() {
    uint8_t packet[wire::kLargest];
    Way to;
    return pairing.reading({}, condition, now_us, packet, to) != 0;
  }
  void dance(uint32_t seconds, const Way& from = kBoxOnWifi) {  // with heartbeats
    for (uint32_t i = 0; i < seconds; ++i) {
      wait(kSecond);
      REQUIRE(hear(box.heartbeat(), from) == Received::kHeartbeat);
    }
  }
};

}  // namespace bunraku
