// Roaming between Wi-Fi and cable, in one session.
#include <doctest/doctest.h>

#include "wearer.h"

using namespace bunraku;

namespace {

const Way kCable = {Lane::kCable, false, {0, 0}};

}  // namespace

TEST_CASE("greets on both lanes until it is answered") {
  Wearer wearer;
  wearer.pairing.set_lane(Lane::kWifi, true);
  wearer.pairing.set_lane(Lane::kCable, true);
  wearer.wait(900'000);
  CHECK(wearer.hellos(Lane::kWifi).size() == 2);
  CHECK(wearer.hellos(Lane::kCable).size() == 2);
}

TEST_CASE("a cable that is connected takes the link over, in the same session") {
  Wearer wearer;
  wearer.link();
  wearer.dance(1);
  wearer.sent.clear();
  wearer.pairing.set_lane(Lane::kCable, true);
  wearer.wait(1'200'000);
  CHECK(wearer.hellos(Lane::kCable).size() == 3);
  CHECK(wearer.hellos(Lane::kWifi).empty());
  Way to;
  wearer.read(&to);
  CHECK(to.lane == Lane::kWifi);  // until assigned there
  REQUIRE(wearer.hear(wearer.box.assignment(wearer.newest_hello()), kCable) == Received::kAssignment);
  wearer.read(&to);
  CHECK(to.lane == Lane::kCable);
  CHECK(wearer.pairing.session() == wearer.box.session);
  wearer.sent.clear();
  wearer.dance(3, kCable);
  CHECK(wearer.sent.empty());
}

TEST_CASE("an answer by Wi-Fi that comes late does not take the link from the cable") {
  Wearer wearer;
  wearer.pairing.set_lane(Lane::kCable, true);
  wearer.pairing.set_lane(Lane::kWifi, true);
  wearer.wait(1000);
  REQUIRE(wearer.newest_hello() == 2);
  CHECK(wearer.hear(wearer.box.assignment(1), kCable) == Received::kAssignment);
  CHECK(wearer.hear(wearer.box.assignment(2)) == Received::kNothing);
  CHECK(wearer.pairing.link().lane == Lane::kCable);
}

TEST_CASE("a cable that is pulled: greeting by Wi-Fi at once, same session") {
  Wearer wearer;
  wearer.pairing.set_lane(Lane::kWifi, true);
  wearer.link(kCable);
  wearer.dance(4, kCable);
  wearer.sent.clear();
  wearer.pairing.set_lane(Lane::kCable, false);
  const uint32_t pulled_us = wearer.now_us;
  CHECK_FALSE(wearer.streams());
  wearer.wait(2000);
  REQUIRE(wearer.hellos(Lane::kWifi).size() == 1);
  CHECK(wearer.hellos(Lane::kWifi)[0].at_us == pulled_us);
  CHECK(wearer.hear(wearer.box.assignment(wearer.newest_hello())) == Received::kAssignment);
  Way to;
  const wire::Reading reading = wearer.read(&to);
  CHECK(to.lane == Lane::kWifi);
  CHECK(reading.session == wearer.box.session);
}

TEST_CASE("Wi-Fi that goes down while linked on the cable changes nothing") {
  Wearer wearer;
  wearer.pairing.set_lane(Lane::kWifi, true);
  wearer.link(kCable);
  wearer.pairing.set_lane(Lane::kWifi, false);
  CHECK(wearer.pairing.link().lane == Lane::kCable);
}
