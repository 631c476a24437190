// Pairing on invented times: greeting, assignment, loss and calls, for hours and over the clock's wrap.
#include <doctest/doctest.h>

#include <cstring>
#include <utility>
#include <vector>

#include "wearer.h"

using namespace bunraku;
using fakes::BoxSide;

TEST_CASE("a hello at once, then every 500 ms, broadcast, counted, signed") {
  Wearer wearer;
  wearer.wait(kSecond);
  CHECK(wearer.sent.empty());  // no lane
  wearer.pairing.set_lane(Lane::kWifi, true);
  wearer.wait(1'250'000);
  const auto hellos = wearer.hellos(Lane::kWifi);
  REQUIRE(hellos.size() == 3);
  for (uint32_t i = 0; i < 3; ++i) {
    CHECK(hellos[i].at_us == hellos[0].at_us + i * kSecond / 2);
    CHECK(hellos[i].to.is_broadcast);
    CHECK(fakes::is_signed(hellos[i].data));
    const auto hello = hellos[i].as<wire::Hello>();
    CHECK(hello.sequence == i + 1);
    CHECK(hello.session == 0);
    CHECK(hello.boot_nonce == kBoot);
    CHECK(hello.wire_hash == wire::kWireHash);
    CHECK(hello.firmware_major == 1);
    CHECK(hello.battery == 77);
    CHECK(memcmp(hello.imu_id, wearer.condition.imu_id, 16) == 0);
  }
}

TEST_CASE("an assignment links to where it came from; readings go there in its session, counted") {
  Wearer wearer;
  wearer.link();
  CHECK(wearer.pairing.session() == wearer.box.session);
  Way to;
  const wire::Reading first = wearer.read(&to);
  CHECK(to.lane == Lane::kWifi);
  CHECK(to.address.ip == kBoxOnWifi.address.ip);
  CHECK(to.address.port == kBoxOnWifi.address.port);
  CHECK_FALSE(to.is_broadcast);
  CHECK(first.session == wearer.box.session);
  CHECK(first.sequence == 1);
  CHECK(wearer.read().sequence == 2);
  wearer.wait(2 * kSecond);
  CHECK(wearer.sent.empty());  // linked: no more hellos
}

TEST_CASE("nothing streams before") {
  Wearer wearer;
  wearer.pairing.set_lane(Lane::kWifi, true);
  wearer.wait(kSecond);
  CHECK_FALSE(wearer.streams());
}

TEST_CASE("rates are those that the IMU's 100 Hz divides into") {
  for (const auto& rate : std::vector<std::pair<uint8_t, uint8_t>>{
           {1, 25}, {25, 25}, {49, 25}, {50, 50}, {99, 50}, {100, 100}, {255, 100}, {0, 25}}) {
    Wearer wearer;
    wearer.pairing.set_lane(Lane::kWifi, true);
    wearer.wait(1000);
    wearer.hear(wearer.box.assignment(1, rate.first));
    CHECK(wearer.pairing.rate_hz() == rate.second);
  }
}

TEST_CASE("three seconds without the box: hellos again, in the present session, and back in it") {
  Wearer wearer;
  wearer.link();
  wearer.dance(5);
  wearer.wait(2'990'000);
  CHECK(wearer.pairing.is_linked());
  CHECK(wearer.sent.empty());
  wearer.wait(20'000);
  CHECK_FALSE(wearer.pairing.is_linked());
  CHECK_FALSE(wearer.streams());
  wearer.wait(kSecond);
  REQUIRE(wearer.hellos(Lane::kWifi).size() >= 2);
  CHECK(wearer.hellos(Lane::kWifi)[0].as<wire::Hello>().session == wearer.box.session);
  CHECK(wearer.hellos(Lane::kWifi)[0].to.is_broadcast);
  CHECK(wearer.hear(wearer.box.assignment(wearer.newest_hello())) == Received::kAssignment);
  CHECK(wearer.streams());
}

TEST_CASE("a restarted box calls; the wearable greets it and joins its session") {
  Wearer wearer;
  wearer.link();
  wearer.dance(2);
  BoxSide restarted = wearer.box;
  restarted.session = 0x22222222;
  restarted.sequence = 0;
  CHECK(wearer.hear(restarted.call()) == Received::kCall);
  wearer.wait(2000);
  REQUIRE(wearer.hellos(Lane::kWifi).size() == 1);
  CHECK_FALSE(wearer.hellos(Lane::kWifi)[0].to.is_broadcast);
  CHECK(wearer.hellos(Lane::kWifi)[0].to.address.ip == kBoxOnWifi.address.ip);
  CHECK(wearer.streams());  // goes on meanwhile
  CHECK(wearer.hear(restarted.assignment(wearer.newest_hello())) == Received::kAssignment);
  CHECK(wearer.pairing.session() == 0x22222222);
  CHECK(wearer.hear(wearer.box.heartbeat()) == Received::kNothing);  // packets of the old session
  CHECK(wearer.hear(restarted.heartbeat()) == Received::kHeartbeat);  // its sequence restarted
}

TEST_CASE("calls are answered at most once in 200 ms") {
  Wearer wearer;
  wearer.link();
  for (int i = 0; i < 100; ++i) {
    wearer.hear(wearer.box.call());
    wearer.wait(10'000);
  }
  CHECK(wearer.hellos(Lane::kWifi).size() == 5);
}

TEST_CASE("everything holds at the clock's wrap") {
  for (const uint32_t before_us : {5'000'000u, 3'000'500u, 500'000u, 1000u}) {
    Wearer wearer(0u - before_us);
    wearer.link();
    wearer.dance(8);
    CHECK(wearer.sent.empty());
    wearer.wait(3'500'000);
    CHECK_FALSE(wearer.pairing.is_linked());
    const uint32_t greeting_us = wearer.now_us - wearer.sent[0].at_us;
    CHECK(wearer.hellos(Lane::kWifi).size() == 1 + (greeting_us - 1) / (kSecond / 2));
  }
}

TEST_CASE("after an hour and more of dancing, loss and calls are noticed as on the first day") {
  Wearer wearer;
  wearer.link();
  wearer.hear(wearer.box.call());
  wearer.dance(5000);  // the clock wraps at 4295 s
  wearer.sent.clear();
  CHECK(wearer.hear(wearer.box.call()) == Received::kCall);
  wearer.wait(1000);
  CHECK(wearer.sent.size() == 1);
  wearer.wait(3'500'000);
  CHECK_FALSE(wearer.pairing.is_linked());
}

TEST_CASE("the round trip is what neither side held") {
  Wearer wearer(0xFFFFFFFFu - 5000);
  wearer.link();
  CHECK(wearer.read().round_trip == wire::kRoundTripUnknown);
  const uint32_t sequence = wearer.read().sequence;
  wearer.wait(14'000);
  wearer.hear(wearer.box.heartbeat(sequence, 11'700));
  CHECK(wearer.pairing.round_trip() == 23);
  CHECK(wearer.read().round_trip == 23);
}

TEST_CASE("no round trip from an echo that cannot be") {
  Wearer wearer;
  wearer.link();
  for (int i = 0; i < 70; ++i) wearer.read();
  wearer.wait(5000);
  wearer.hear(wearer.box.heartbeat(70, 6000));    // held for longer than it was away
  wearer.hear(wearer.box.heartbeat(6, 0));        // too long ago to be remembered
  wearer.hear(wearer.box.heartbeat(71, 0));       // never sent
  wearer.hear(wearer.box.heartbeat(0, 0));        // none arrived yet
  CHECK(wearer.pairing.round_trip() == wire::kRoundTripUnknown);
  wearer.hear(wearer.box.heartbeat(7, 1000));
  CHECK(wearer.pairing.round_trip() == 40);
}

TEST_CASE("the contents of a hello can be updated on a live link") {
  Wearer wearer;
  wearer.pairing.introduce();
  wearer.wait(kSecond);
  CHECK(wearer.sent.empty());
  wearer.link();
  wearer.pairing.introduce();
  wearer.wait(2000);
  REQUIRE(wearer.hellos(Lane::kWifi).size() == 1);
  CHECK_FALSE(wearer.hellos(Lane::kWifi)[0].to.is_broadcast);
}
