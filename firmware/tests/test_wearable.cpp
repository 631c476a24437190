// The whole wearable on small fakes: from power-on to readings, by both lanes, and everything around that.
#include <doctest/doctest.h>

#include <cstdio>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "box_side.h"
#include "fakes.h"
#include "framing.h"
#include "settings.h"
#include "version.h"
#include "wearable.h"

using namespace bunraku;
using fakes::Bytes;
using fakes::signed_packet;

namespace {

constexpr uint32_t kSecond = 1'000'000;
constexpr uint32_t kTurnUs = 250;
constexpr uint16_t kPort = 9750;
const Address kBoxAddress = {0xC0A80401, kPort};

Settings provisioned() {
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
    wearable = std::make_unique<Wearable>(Ports{clock, imu, wifi, serial, flash, led, board});
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
  void say(const Bytes& packet, bool by_cable = false) {
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
        hear(Bytes(host_.packet(), host_.packet() + host_.packet_bytes()), true);
    }
    serial.to_host.clear();
    if (!is_box_on || !is_linked() || static_cast<int32_t>(clock.now_us - heartbeat_at_us_) < 0) return;
    heartbeat_at_us_ = clock.now_us + kSecond;
    const uint32_t newest = readings.empty() ? 0 : readings.back().sequence;
    say(signed_packet(box.heartbeat(newest, 0)), wearable->status().lane == Lane::kCable);
  }
  void hear(const Bytes& data, bool by_cable) {
    CHECK(fakes::is_signed(data));
    if (data[3] == wire::Hello::kKind) {
      hellos.push_back(decoded<wire::Hello>(data));
      if (by_cable) ++hellos_by_cable;
      if (is_box_on) say(signed_packet(box.assignment(hellos.back().sequence)), by_cable);
    } else if (data[3] == wire::Reading::kKind) {
      readings.push_back(decoded<wire::Reading>(data));
      reading_times_us.push_back(clock.now_us);
      if (by_cable) ++readings_by_cable;
    } else {
      profiles.push_back(decoded<wire::Profile>(data));
    }
  }
  template <typename Packet>
  static Packet decoded(const Bytes& data) {
    REQUIRE(data.size() == Packet::kSize);
    Packet packet;
    packet.read(data.data());
    return packet;
  }

  CableInput host_;
  uint32_t heartbeat_at_us_ = 0;
};

}  // namespace

TEST_CASE("power-on to readings, unattended") {
  Stage stage;
  stage.provision_and_switch_on();
  stage.run(3 * kSecond);
  CHECK(stage.is_linked());
  CHECK(stage.wifi.joined_as == "stage/break a leg");
  CHECK(stage.wifi.own_port == 2390);
  CHECK(stage.wifi.joins == 1);
  REQUIRE(stage.hellos.size() >= 1);
  CHECK(stage.hellos[0].imu_id[0] == 0x50);  // the first hello tells whose calibration is wanted
  REQUIRE(stage.readings.size() >= 80);
  const wire::Reading& reading = stage.readings.back();
  CHECK(reading.session == stage.box.session);
  CHECK(reading.orientation[0] == 16384);
  CHECK(reading.battery == stage.wearable->status().battery);
  CHECK(reading.round_trip != wire::kRoundTripUnknown);
  CHECK(stage.imu.mode() == 0x08);
}

TEST_CASE("readings keep a grid of 20 ms, over the clock's wrap") {
  Stage stage(0xFFFFFFFFu - 5 * kSecond);
  stage.link();
  stage.run(20 * kSecond);
  REQUIRE(stage.readings.size() == 1000);
  for (size_t i = 1; i < stage.readings.size(); ++i) {
    const uint32_t apart_us = stage.reading_times_us[i] - stage.reading_times_us[i - 1];
    CHECK(apart_us >= 20'000 - kTurnUs);
    CHECK(apart_us <= 20'000 + kTurnUs);
    CHECK(stage.readings[i].sequence == stage.readings[i - 1].sequence + 1);
  }
}

TEST_CASE("a stall costs slots; they are skipped and counted, never sent in a burst") {
  Stage stage;
  stage.link();
  const uint32_t skipped = stage.wearable->status().skipped;
  stage.clock.now_us += 110'000;
  stage.run(kSecond);
  CHECK(stage.wearable->status().skipped == skipped + 5);
  CHECK(stage.readings.size() >= 49);
  CHECK(stage.readings.size() <= 51);
  for (size_t i = 2; i < stage.readings.size(); ++i)
    CHECK(stage.reading_times_us[i] - stage.reading_times_us[i - 1] >= 20'000 - kTurnUs);
}

TEST_CASE("the watchdog is fed each turn") {
  Stage stage;
  stage.provision_and_switch_on();
  const int before = stage.board.feedings;
  stage.run(100 * kTurnUs);
  CHECK(stage.board.feedings - before >= 2);
  stage.run(3 * kSecond);
  const int linked = stage.board.feedings;
  stage.run(1000 * kTurnUs);
  CHECK(stage.board.feedings == linked + 1000);
}

TEST_CASE("the assignment's rate is kept") {
  Stage stage;
  stage.link();
  stage.box.session ^= 1;
  stage.say(signed_packet(stage.box.call()));
  stage.is_box_on = false;
  stage.run(10'000);
  REQUIRE(stage.hellos.size() == 1);
  stage.say(signed_packet(stage.box.assignment(stage.hellos[0].sequence, 100)));
  stage.run(100'000);
  stage.forget_traffic();
  stage.run(kSecond);
  CHECK(stage.readings.size() == 100);
}

TEST_CASE("a fresh board joins no network, greets no box, and is provisioned by cable") {
  Stage stage;
  stage.serial.is_open = true;
  stage.switch_on();
  stage.run(5 * kSecond);
  CHECK(stage.wearable->status().state == State::kNotProvisioned);
  CHECK(stage.wifi.joins == 0);
  CHECK(stage.hellos.empty());
  char beginning[64];
  snprintf(beginning, sizeof beginning, "ok bunraku-wearable %s wire %08x i", kFirmwareVersion, wire::kWireHash);
  CHECK(stage.ask("id").substr(0, strlen(beginning)) == beginning);
  CHECK(stage.ask("id").find("board b0a2d001") != std::string::npos);
  for (const char* line :
       {"set name left-wrist", "set device 1a2b3c4d", "set key 000102030405060708090a0b0c0d0e0f",
        "set network stage", "set password break a leg"})
    CHECK(stage.ask(line) == "ok");
  CHECK(stage.wearable->status().state == State::kNotProvisioned);
  CHECK(stage.ask("save") == "ok saved");
  CHECK(stage.ask("prove 0000000000000000").substr(0, 3) == "ok ");
  CHECK(stage.wifi.joins == 0);  // nothing blocks while someone talks to it
  stage.run(6 * kSecond);
  CHECK(stage.is_linked());
  stage.switch_on();
  stage.run(3 * kSecond);
  CHECK(stage.is_linked());
}

TEST_CASE("a flash that fails is said, and nothing is adopted") {
  Stage stage;
  stage.serial.is_open = true;
  stage.switch_on();
  stage.ask("set device 1a2b3c4d");
  stage.ask("set key 000102030405060708090a0b0c0d0e0f");
  stage.flash.is_broken = true;
  CHECK(stage.ask("save").substr(0, 7) == "error: ");
  CHECK(stage.ask("forget").substr(0, 7) == "error: ");
  CHECK(stage.wearable->status().state == State::kNotProvisioned);
}

TEST_CASE("what was set and not saved is forgotten with the cable") {
  Stage stage;
  stage.serial.is_open = true;
  stage.provision_and_switch_on();
  stage.ask("set name right-wrist");
  CHECK(stage.ask("show").find("name right-wrist") != std::string::npos);
  stage.serial.is_open = false;
  stage.run(kSecond);
  stage.serial.is_open = true;
  stage.run(kSecond);
  CHECK(stage.ask("show").find("name left-wrist") != std::string::npos);
}

TEST_CASE("forget: unlinked at once, and after power-off too") {
  Stage stage;
  stage.link();
  stage.serial.is_open = true;
  CHECK(stage.ask("forget") == "ok forgotten");
  CHECK(stage.wearable->status().state == State::kNotProvisioned);
  stage.forget_traffic();
  stage.run(5 * kSecond);
  CHECK(stage.hellos.empty());
  CHECK(stage.readings.empty());
  stage.switch_on();
  CHECK(stage.wearable->status().state == State::kNotProvisioned);
}

TEST_CASE("without a network it lives on the cable alone") {
  Stage stage;
  Settings settings = provisioned();
  settings.network[0] = '\0';
  stage.serial.is_open = stage.has_box_cable = true;
  stage.provision_and_switch_on(settings);
  stage.run(5 * kSecond);
  CHECK(stage.is_linked());
  CHECK(stage.wearable->status().lane == Lane::kCable);
  CHECK(stage.wifi.joins == 0);
  CHECK(stage.readings_by_cable >= 180);
  stage.serial.is_open = false;
  stage.run(kSecond);
  CHECK_FALSE(stage.is_linked());
  CHECK(stage.wearable->status().state == State::kGreeting);
}

TEST_CASE("linked on the cable, no join interrupts it, even if Wi-Fi is gone") {
  Stage stage;
  stage.serial.is_open = stage.has_box_cable = true;
  stage.wifi.is_there = false;
  stage.provision_and_switch_on();
  stage.run(60 * kSecond);
  CHECK(stage.is_linked());
  CHECK(stage.wifi.joins == 0);
  CHECK(stage.wearable->status().skipped == 0);
}

TEST_CASE("roaming: the cable takes over without a gap, and gives back when it is pulled") {
  Stage stage;
  stage.link();
  stage.serial.is_open = stage.has_box_cable = true;
  stage.run(kSecond);
  CHECK(stage.wearable->status().lane == Lane::kCable);
  CHECK(stage.readings.size() == 50);
  stage.forget_traffic();
  stage.serial.is_open = false;
  stage.run(kSecond);
  CHECK(stage.wearable->status().lane == Lane::kWifi);
  CHECK(stage.readings.size() >= 49);
  CHECK(stage.wifi.joins == 1);
  CHECK(stage.readings.back().session == stage.box.session);
}

TEST_CASE("someone at the console hears no hellos, and the stream by Wi-Fi goes on") {
  Stage stage;
  stage.link();
  stage.serial.is_open = true;
  stage.run(100'000);
  CHECK(stage.ask("show").find("network stage") != std::string::npos);
  stage.has_box_cable = true;
  stage.hellos_by_cable = 0;
  stage.run(2 * kSecond);
  CHECK(stage.hellos_by_cable == 0);
  CHECK(stage.readings.size() >= 100);
  stage.run(2 * kSecond);
  CHECK(stage.hellos_by_cable >= 1);
}

TEST_CASE("answers come whole while readings go by the same cable") {
  Stage stage;
  stage.serial.is_open = stage.has_box_cable = true;
  stage.serial.room_to_host = 5;
  stage.provision_and_switch_on();
  stage.run(2 * kSecond);
  REQUIRE(stage.wearable->status().lane == Lane::kCable);
  stage.lines.clear();
  for (int i = 0; i < 20; ++i) stage.type("show\n");
  stage.run(kSecond);
  CHECK(stage.lines.size() == 20);
  for (const std::string& line : stage.lines) CHECK(line == stage.lines[0]);
  CHECK(stage.is_linked());
}

TEST_CASE("an overlong line is refused; garbage harms nothing") {
  Stage stage;
  stage.link();
  stage.serial.is_open = true;
  CHECK(stage.ask(std::string(200, 'x')) ==
        "error: a line has 128 bytes at most, nothing was done; type help");
  uint32_t noise = 1;
  for (int i = 0; i < 5000; ++i) {
    noise = noise * 1664525 + 1013904223;
    stage.serial.to_wearable.push_back(static_cast<uint8_t>(noise >> 24));
  }
  stage.run(kSecond);
  CHECK(stage.is_linked());
  stage.run(kSecond);
  stage.type("\n");
  CHECK(stage.ask("id").substr(0, 3) == "ok ");
}

TEST_CASE("the box goes silent: greeting after 3 s, the network rejoined 10 s later, then less often") {
  Stage stage;
  stage.link();
  stage.is_box_on = false;
  stage.run(5 * kSecond);
  CHECK_FALSE(stage.is_linked());
  CHECK(stage.hellos.size() >= 2);
  CHECK(stage.wifi.leaves == 0);
  stage.run(10 * kSecond);
  CHECK(stage.wifi.leaves == 1);
  CHECK(stage.wifi.joins == 2);
  stage.run(120 * kSecond);
  CHECK(stage.wifi.leaves >= 3);
  CHECK(stage.wifi.leaves <= 6);
  stage.is_box_on = true;
  stage.run(2 * kSecond);
  CHECK(stage.is_linked());
}

TEST_CASE("the access point goes: hellos stop, joins go on with pauses, all is back when it is back") {
  Stage stage;
  stage.link();
  stage.wifi.is_there = stage.wifi.is_joined = stage.wifi.is_open = false;
  stage.wifi.join_us = 3 * kSecond;
  stage.run(20 * kSecond);
  CHECK(stage.wearable->status().state == State::kJoining);
  CHECK(stage.wifi.joins >= 4);
  stage.wifi.is_there = true;
  stage.run(6 * kSecond);
  CHECK(stage.is_linked());
}

TEST_CASE("no join while linked, whatever the driver says") {
  Stage stage;
  stage.link();
  stage.run(300 * kSecond);
  CHECK(stage.wifi.joins == 1);
  CHECK(stage.wifi.leaves == 0);
  CHECK(stage.wearable->status().skipped <= 51);  // by the first join, of a second
}

TEST_CASE("a flood of strangers' datagrams costs no reading") {
  Stage stage;
  stage.link();
  const Bytes forged = signed_packet(stage.box.heartbeat(), fakes::kOtherKey);
  for (int i = 0; i < 400; ++i) {  // 10,000 a second
    for (int k = 0; k < 25; ++k) stage.wifi.received.push_back({{1, 2}, false, forged});
    stage.run(2500);
    while (stage.wifi.received.size() > 30) stage.wifi.received.pop_back();  // as a driver's buffer does
  }
  CHECK(stage.readings.size() == 50);
  CHECK(stage.wearable->status().dropped.forged > 1000);
  CHECK(stage.is_linked());
}

TEST_CASE("without an IMU: greeted all the same, no readings; it is read as soon as it is there") {
  Stage stage;
  stage.imu.is_there = false;
  stage.provision_and_switch_on();
  stage.run(8 * kSecond);
  CHECK(stage.hellos.size() >= 1);
  CHECK(stage.hellos[0].imu_id[0] == 0);
  CHECK(stage.readings.empty());
  CHECK_FALSE(stage.wearable->status().has_imu);
  stage.imu.is_there = true;
  stage.run(2 * kSecond);
  CHECK(stage.readings.size() >= 50);
  CHECK(stage.hellos.back().imu_id[0] == 0x50);
}

TEST_CASE("a calibration complete before the first link is saved, told to the box, and used next time") {
  Stage stage;
  stage.is_box_on = false;
  stage.imu.calibrate(0x3C);
  stage.provision_and_switch_on();
  stage.run(8 * kSecond);
  CHECK(stage.wearable->status().has_profile);
  stage.is_box_on = true;
  stage.run(6 * kSecond);
  REQUIRE(stage.profiles.size() == 3);
  CHECK(stage.profiles[0].offsets[0] == 5);
  const int saves = stage.flash.saves;
  stage.imu.profiles_written = 0;
  stage.switch_on();
  stage.run(6 * kSecond);
  CHECK(stage.wearable->status().has_profile);
  CHECK(stage.imu.profiles_written <= 1);
  CHECK(stage.flash.saves == saves + 1);  // the count of power-ons
}

TEST_CASE("a calibration that is complete while linked is not saved: the heading would be lost") {
  Stage stage;
  stage.link();
  const int saves = stage.flash.saves;
  stage.imu.calibrate(0x3F);
  stage.run(20 * kSecond);
  CHECK(stage.flash.saves == saves);
  stage.is_box_on = false;  // a short loss is part of a show
  stage.run(20 * kSecond);
  CHECK(stage.flash.saves == saves);
  stage.run(60 * kSecond);
  CHECK(stage.flash.saves == saves + 1);
}

TEST_CASE("calibration save by console: says what hinders it") {
  Stage stage;
  stage.serial.is_open = true;
  stage.imu.is_there = false;
  stage.switch_on();
  stage.run(kSecond);
  CHECK(stage.ask("calibration save") == "error: no running IMU, nothing was saved; check its wiring");
  stage.imu.is_there = true;
  stage.run(5 * kSecond);
  CHECK(stage.ask("calibration save").substr(0, 28) == "error: not calibrated yet, n");
  stage.imu.calibrate(0x3C);
  stage.run(5 * kSecond);
  CHECK(stage.ask("calibration save").substr(0, 9) == "ok saving");
  stage.run(kSecond);
  CHECK(stage.wearable->status().has_profile);
}

TEST_CASE("a calibration that the box kept is restored and saved") {
  Stage stage;
  stage.link();
  REQUIRE_FALSE(stage.wearable->status().has_profile);
  const uint8_t recoveries = stage.wearable->status().recoveries;
  stage.say(signed_packet(stage.box.restore(stage.hellos.empty() ? stage.wearable->status().imu_id
                                                                 : stage.hellos[0].imu_id)));
  stage.run(kSecond);
  CHECK(stage.wearable->status().has_profile);
  CHECK(stage.wearable->status().recoveries == static_cast<uint8_t>(recoveries + 1));  // its heading was lost
  CHECK(stage.readings.back().flags == wire::kHasProfile);
  uint8_t offsets[kProfileBytes];
  CHECK(load_profile(stage.flash, stage.wearable->status().imu_id, offsets));
}

TEST_CASE("a calibration that the flash did not take is in use, told to the box, and said") {
  Stage stage;
  stage.is_box_on = false;
  stage.serial.is_open = true;
  stage.provision_and_switch_on();
  stage.imu.calibrate(0x3C);
  stage.run(5 * kSecond);
  REQUIRE(stage.wearable->status().has_profile);  // saved by itself
  stage.flash.is_broken = true;
  CHECK(stage.ask("calibration save").substr(0, 9) == "ok saving");
  stage.run(2 * kSecond);
  REQUIRE(stage.lines.size() == 2);
  CHECK(stage.lines[1] == "note: the flash did not take the calibration, it counts until power-off; try again");
  CHECK(stage.wearable->status().has_profile);
  CHECK(stage.wearable->status().is_profile_unsaved);
  stage.flash.is_broken = false;
  CHECK(stage.ask("calibration save").substr(0, 9) == "ok saving");
  stage.run(2 * kSecond);
  CHECK(stage.lines.size() == 1);
  CHECK_FALSE(stage.wearable->status().is_profile_unsaved);
}

TEST_CASE("a kept calibration that the flash did not take is in use, and status says so") {
  Stage stage;
  stage.link();
  stage.flash.is_broken = true;
  stage.say(signed_packet(stage.box.restore(stage.wearable->status().imu_id)));
  stage.run(kSecond);
  CHECK(stage.wearable->status().has_profile);
  CHECK(stage.wearable->status().is_profile_unsaved);
}

TEST_CASE("after a hang the port has ten seconds before the next join, and all the time once it is open") {
  for (const bool is_opened : {false, true}) {
    Stage stage;
    stage.is_box_on = false;
    stage.board.has_hung = true;
    stage.provision_and_switch_on();
    stage.run(9 * kSecond);
    CHECK(stage.wifi.joins == 0);
    stage.serial.is_open = is_opened;
    stage.run(20 * kSecond);
    CHECK((stage.wifi.joins == 0) == is_opened);
    stage.serial.is_open = false;
    stage.run(3 * kSecond);
    CHECK(stage.wifi.joins >= 1);
  }
}

TEST_CASE("strobe from the console, for ten seconds") {
  Stage stage;
  stage.serial.is_open = true;
  stage.switch_on();
  CHECK(stage.ask("strobe") == "ok");
  stage.led.changes = 0;
  stage.run(kSecond);
  CHECK(stage.led.changes == 20);
  stage.run(9 * kSecond);
  stage.led.changes = 0;
  stage.run(2 * kSecond);
  CHECK(stage.led.changes == 4);  // two flashes: not provisioned
}

TEST_CASE("the lamp follows the box") {
  Stage stage;
  stage.link();
  stage.say(signed_packet(stage.box.heartbeat(0, 0, wire::kLedStrobe)));
  stage.is_box_on = false;
  stage.run(10'000);
  stage.led.changes = 0;
  stage.run(kSecond);
  CHECK(stage.led.changes == 20);
}

TEST_CASE("restart answers first") {
  Stage stage;
  stage.serial.is_open = true;
  stage.switch_on();
  CHECK(stage.ask("restart") == "ok restarting");
  CHECK(stage.board.restarts == 0);
  stage.run(200'000);
  CHECK(stage.board.restarts >= 1);
}

TEST_CASE("a double tap is counted in the readings") {
  Stage stage;
  stage.link();
  stage.run(kSecond);
  for (int i = 0; i < 2; ++i) {
    stage.imu.accelerate(2500);
    stage.run(20'000);
    stage.imu.accelerate(0);
    stage.run(180'000);
  }
  CHECK(stage.readings.back().taps == 0);
  stage.run(kSecond);
  CHECK(stage.readings.back().taps == 1);
}

TEST_CASE("two power-ons never have the same boot nonce") {
  Stage stage;
  stage.provision_and_switch_on();
  const uint32_t first = stage.wearable->status().boot_nonce;
  stage.switch_on();
  CHECK(stage.wearable->status().boot_nonce != first);
}

TEST_CASE("other settings by cable while linked by Wi-Fi: the old link is left, the new one found") {
  Stage stage;
  stage.link();
  stage.serial.is_open = true;
  CHECK(stage.ask("set network cellar") == "ok");
  CHECK(stage.ask("set fusion ndof") == "ok");
  stage.run(kSecond);
  CHECK(stage.is_linked());  // a draft changes nothing
  CHECK(stage.ask("save") == "ok saved");
  CHECK_FALSE(stage.is_linked());
  stage.run(8 * kSecond);
  CHECK(stage.wifi.joined_as == "cellar/break a leg");
  CHECK(stage.is_linked());
  CHECK(stage.imu.mode() == 0x0C);
  CHECK(stage.readings.back().flags == wire::kIsNdof);
}
