// A whole wearable on small fakes, in virtual time, and a box that answers it by Wi-Fi and by cable.
#pragma once

#include <doctest/doctest.h>

#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "bno055.h"
#include "box_side.h"
#include "fakes.h"
#include "framing.h"
#include "second.h"
#include "settings.h"
#include "wearable.h"

namespace bunraku {

constexpr uint32_t kTurnUs = 250;
constexpr uint16_t kPort = 9750;
inline const Address kBoxAddress = {0xC0A80401, kPort};

inline Settings provisioned() {
  Settings settings;
  strcpy(settings.name, "left-wrist");
  settings.device_id = 0x1A2B3C4D;
  settings.has_key = true;
  memcpy(settings.key, fakes::kKey, sizeof settings.key);
  strcpy(settings.network, "stage");
  strcpy(settings.password, "break a leg");
  return settings;
}

// A wearable on its fakes, and a box that may be on: it answers hellos and says a heartbeat each second.
struct Stage {
  fakes::FakeClock clock;
  fakes::FakeImu imu;
  fakes::FakeWifi wifi{clock};
  fakes::FakeSerial serial;
  fakes::FakeFlash flash;
  fakes::FakeLed led;
  fakes::FakeBoard board;
  std::unique_ptr<Bno055> driver;
  std::unique_ptr<Wearable> wearable;

  fakes::BoxSide box;
  bool is_box_on = true;
  bool has_box_cable = false;
  std::vector<wire::Hello> hellos;
  std::vector<wire::Reading> readings;
  std::vector<uint32_t> reading_times_us;
  std::vector<wire::Profile> profiles;
  std::vector<std::string> lines;
  uint32_t hellos_by_cable = 0, readings_by_cable = 0;

  explicit Stage(uint32_t start_us = 1'000) { clock.now_us = start_us; }

  void switch_on() {
    wearable.reset();
    driver = std::make_unique<Bno055>(imu);
    wearable = std::make_unique<Wearable>(Ports{clock, *driver, wifi, serial, flash, led, board});
    wearable->begin();
    box.boot_nonce = wearable->status().boot_nonce;
    heartbeat_at_us_ = clock.now_us;
  }
  void provision_and_switch_on(const Settings& settings = provisioned()) {
    save_settings(flash, settings);
    switch_on();
  }
  void run(uint32_t us) {
    for (const uint32_t end_us = clock.now_us + us; static_cast<int32_t>(end_us - clock.now_us) > 0;) {
      wearable->step();
      listen();
      clock.now_us += kTurnUs;
    }
  }
  void link() {
    provision_and_switch_on();
    run(3 * kSecond);
    REQUIRE(is_linked());
    forget_traffic();
  }
  void forget_traffic() {
    hellos.clear();
    readings.clear();
    reading_times_us.clear();
    hellos_by_cable = readings_by_cable = 0;
  }
  bool is_linked() const { return wearable->status().state == State::kLinked; }
  std::string ask(const std::string& line) {
    lines.clear();
    type(line + "\r\n");
    run(50'000);
    return lines.empty() ? "" : lines.front();
  }
  void type(const std::string& text) {
    serial.to_wearable.insert(serial.to_wearable.end(), text.begin(), text.end());
  }
  void say(const fakes::Bytes& packet, bool by_cable = false) {
    if (!by_cable) return wifi.received.push_back({kBoxAddress, false, packet});
    uint8_t framed[kLongestFrame];
    const uint8_t count = frame(packet.data(), static_cast<uint8_t>(packet.size()), framed);
    serial.to_wearable.insert(serial.to_wearable.end(), framed, framed + count);
  }

 private:
  void listen() {
    while (!wifi.sent.empty()) {
      hear(wifi.sent.front().data, false);
      wifi.sent.pop_front();
    }
    for (const uint8_t byte : serial.to_host) {
      const CableInput::Found found = host_.feed(byte, clock.now_us);
      if (found == CableInput::Found::kLine) lines.push_back(host_.line());
      if (found == CableInput::Found::kPacket && has_box_cable)
        hear(fakes::Bytes(host_.packet(), host_.packet() + host_.packet_bytes()), true);
    }
    serial.to_host.clear();
    if (!is_box_on || !is_linked() || static_cast<int32_t>(clock.now_us - heartbeat_at_us_) < 0) return;
    heartbeat_at_us_ = clock.now_us + kSecond;
    const uint32_t newest = readings.empty() ? 0 : readings.back().sequence;
    say(fakes::signed_packet(box.heartbeat(newest, 0)), wearable->status().lane == Lane::kCable);
  }
  void hear(const fakes::Bytes& data, bool by_cable) {
    CHECK(fakes::is_signed(data));
    if (data[3] == wire::Hello::kKind) {
      hellos.push_back(decoded<wire::Hello>(data));
      if (by_cable) ++hellos_by_cable;
      if (is_box_on) say(fakes::signed_packet(box.assignment(hellos.back().sequence)), by_cable);
    } else if (data[3] == wire::Reading::kKind) {
      readings.push_back(decoded<wire::Reading>(data));
      reading_times_us.push_back(clock.now_us);
      if (by_cable) ++readings_by_cable;
    } else {
      profiles.push_back(decoded<wire::Profile>(data));
    }
  }
  template <typename Packet>
  static Packet decoded(const fakes::Bytes& data) {
    REQUIRE(data.size() == Packet::kSize);
    Packet packet;
    packet.read(data.data());
    return packet;
  }

  CableInput host_;
  uint32_t heartbeat_at_us_ = 0;
};

}  // namespace bunraku
