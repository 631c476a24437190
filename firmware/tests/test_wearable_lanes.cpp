// The wearable's two lanes: only the cable, or both cable and Wi-Fi; networks that go and come back;
// strangers.
#include <doctest/doctest.h>

#include "stage.h"

using namespace bunraku;
using fakes::Bytes;
using fakes::signed_packet;

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
