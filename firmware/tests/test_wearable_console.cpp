// Someone at the wearable's console: provisioned, told, changed, and never in the way of the readings.
#include <doctest/doctest.h>

#include <cstdio>
#include <cstring>
#include <string>

#include "stage.h"
#include "version.h"

using namespace bunraku;

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
  CHECK(stage.ask(std::string(200, 'x')) == "error: a line has 128 bytes at most, nothing was done; type help");
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

TEST_CASE("restart answers first") {
  Stage stage;
  stage.serial.is_open = true;
  stage.switch_on();
  CHECK(stage.ask("restart") == "ok restarting");
  CHECK(stage.board.restarts == 0);
  stage.run(200'000);
  CHECK(stage.board.restarts >= 1);
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
