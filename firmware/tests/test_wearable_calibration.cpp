// The wearable's calibration: saved when it costs no heading, told to the box, restored from there.
#include <doctest/doctest.h>

#include "stage.h"

using namespace bunraku;
using fakes::signed_packet;

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
  stage.say(signed_packet(
      stage.box.restore(stage.hellos.empty() ? stage.wearable->status().imu_id : stage.hellos[0].imu_id)));
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
