// The whole wearable from power-on to readings: on their grid, at the box's rate, with taps and the lamp.
#include <doctest/doctest.h>

#include "stage.h"

using namespace bunraku;
using fakes::signed_packet;

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

TEST_CASE("two power-ons never have the same boot nonce") {
  Stage stage;
  stage.provision_and_switch_on();
  const uint32_t first = stage.wearable->status().boot_nonce;
  stage.switch_on();
  CHECK(stage.wearable->status().boot_nonce != first);
}

TEST_CASE("crystal, old radio and signal stand in the flags of hello and readings; what is unknown does not") {
  const struct {
    Radio radio;
    uint8_t flags;
  } radios[] = {{{}, 0},
                {{{19, 6, 1}, -62}, 7 << wire::kSignalShift},
                {{{19, 6, 1}, -60}, 8 << wire::kSignalShift},
                {{{19, 5, 4}, -127}, 1 << wire::kSignalShift},
                {{{19, 5, 3}, -10}, wire::kRadioIsOld | 15 << wire::kSignalShift},
                {{{19, 4, 200}, 0}, wire::kRadioIsOld}};
  for (const auto& known : radios) {
    CAPTURE(known.radio.rssi_dbm);
    Stage stage;
    stage.wifi.told = known.radio;
    Settings settings = provisioned();
    settings.imu.has_crystal = true;
    stage.provision_and_switch_on(settings);
    stage.run(3 * kSecond);
    REQUIRE(stage.is_linked());
    REQUIRE(!stage.hellos.empty());
    REQUIRE(!stage.readings.empty());
    const auto expected = static_cast<uint8_t>(known.flags | wire::kHasCrystal);
    CHECK(stage.hellos.back().flags == expected);
    CHECK(stage.readings.back().flags == expected);
    CHECK(stage.wearable->status().radio.rssi_dbm == known.radio.rssi_dbm);
  }
}

TEST_CASE("a crystal that is set later is told to a chip that fuses already") {
  Stage stage;
  stage.provision_and_switch_on();
  stage.run(3 * kSecond);
  REQUIRE(stage.imu.trigger() == 0);
  stage.serial.is_open = true;
  stage.run(kSecond);
  CHECK(stage.ask("set crystal yes") == "ok");
  CHECK(stage.ask("save") == "ok saved");
  stage.run(3 * kSecond);
  CHECK(stage.imu.trigger() == 0x80);
  CHECK(stage.ask("set crystal no") == "ok");
  CHECK(stage.ask("save") == "ok saved");
  stage.run(3 * kSecond);
  CHECK(stage.imu.trigger() == 0);
}
