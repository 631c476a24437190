// Every sender that must not be trusted: replayed, forged, foreign, malformed, or without a key.
#include <doctest/doctest.h>

#include "wearer.h"

using namespace bunraku;
using fakes::BoxSide;
using fakes::Bytes;
using fakes::signed_packet;

namespace {

const Way kStranger = {Lane::kWifi, false, {0xC0A80466, 6666}};

}  // namespace

TEST_CASE("an assignment answers the newest hello or one of three before it, each once") {
  Wearer wearer;
  wearer.pairing.set_lane(Lane::kWifi, true);
  wearer.wait(3'600'000);  // 8 hellos
  REQUIRE(wearer.newest_hello() == 8);
  CHECK(wearer.hear(wearer.box.assignment(4)) == Received::kNothing);
  CHECK(wearer.hear(wearer.box.assignment(9)) == Received::kNothing);
  CHECK(wearer.hear(wearer.box.assignment(0)) == Received::kNothing);
  CHECK_FALSE(wearer.pairing.is_linked());
  CHECK(wearer.hear(wearer.box.assignment(5)) == Received::kAssignment);
  CHECK(wearer.hear(wearer.box.assignment(5)) == Received::kNothing);
  CHECK(wearer.pairing.counts().replayed == 4);
  wearer.box.session ^= 1;
  CHECK(wearer.hear(wearer.box.assignment(8)) == Received::kAssignment);
  wearer.box.session ^= 1;
  CHECK(wearer.hear(wearer.box.assignment(7)) == Received::kNothing);
  CHECK(wearer.pairing.counts().replayed == 5);
}

TEST_CASE("relaying the box's answer to a live link does not divert the stream") {
  Wearer wearer;
  wearer.link();
  wearer.hear(wearer.box.call());
  wearer.wait(2000);
  CHECK(wearer.hear(wearer.box.assignment(wearer.newest_hello()), kStranger) == Received::kNothing);
  CHECK(wearer.pairing.link().address.ip == kBoxOnWifi.address.ip);
}

TEST_CASE("a session of 0 is none") {
  Wearer wearer;
  wearer.pairing.set_lane(Lane::kWifi, true);
  wearer.wait(1000);
  wearer.box.session = 0;
  CHECK(wearer.hear(wearer.box.assignment(1)) == Received::kNothing);
  CHECK_FALSE(wearer.pairing.is_linked());
}

TEST_CASE("a replayed assignment does not move the link") {
  Wearer wearer;
  wearer.pairing.set_lane(Lane::kWifi, true);
  wearer.wait(1000);
  const Bytes recorded = signed_packet(wearer.box.assignment(1));
  REQUIRE(wearer.hear(recorded) == Received::kAssignment);
  CHECK(wearer.hear(recorded, kStranger) == Received::kNothing);
  CHECK(wearer.pairing.link().address.ip == kBoxOnWifi.address.ip);
}

TEST_CASE("forged, of another device, of another power-on: counted, and nothing happens") {
  Wearer wearer;
  wearer.pairing.set_lane(Lane::kWifi, true);
  wearer.wait(1000);
  CHECK(wearer.hear(signed_packet(wearer.box.assignment(1), fakes::kOtherKey)) == Received::kNothing);
  CHECK(wearer.pairing.counts().forged == 1);
  BoxSide other = wearer.box;
  other.device_id ^= 1;
  CHECK(wearer.hear(other.assignment(1)) == Received::kNothing);
  other = wearer.box;
  other.boot_nonce ^= 1;  // recorded before the wearable was switched off and on
  CHECK(wearer.hear(other.assignment(1)) == Received::kNothing);
  CHECK(wearer.pairing.counts().foreign == 2);
  CHECK_FALSE(wearer.pairing.is_linked());
}

TEST_CASE("one flipped bit anywhere, or another length: not believed") {
  Wearer wearer;
  wearer.pairing.set_lane(Lane::kWifi, true);
  wearer.wait(1000);
  const Bytes whole = signed_packet(wearer.box.assignment(1));
  for (size_t at = 0; at < whole.size(); ++at) {
    for (uint8_t bit = 0; bit < 8; ++bit) {
      Bytes flipped = whole;
      flipped[at] = static_cast<uint8_t>(flipped[at] ^ 1 << bit);
      CHECK(wearer.hear(flipped) == Received::kNothing);
    }
  }
  for (size_t count = 0; count < whole.size(); ++count)
    CHECK(wearer.hear(Bytes(whole.begin(), whole.begin() + static_cast<long>(count))) == Received::kNothing);
  Bytes longer = whole;
  longer.push_back(0);
  CHECK(wearer.hear(longer) == Received::kNothing);
  CHECK_FALSE(wearer.pairing.is_linked());
  CHECK(wearer.hear(whole) == Received::kAssignment);
}

TEST_CASE("its own packets, sent back, are not believed") {
  Wearer wearer;
  wearer.link();
  wearer.read();
  uint8_t packet[wire::kLargest];
  Way to;
  const uint8_t count = wearer.pairing.reading({}, wearer.condition, wearer.now_us, packet, to);
  CHECK(wearer.hear(Bytes(packet, packet + count)) == Received::kNothing);
  Wearer greeting;
  greeting.pairing.set_lane(Lane::kWifi, true);
  greeting.wait(1000);
  CHECK(greeting.hear(greeting.sent[0].data) == Received::kNothing);
  CHECK(wearer.pairing.counts().malformed == 1);
  CHECK(greeting.pairing.counts().malformed == 1);
}

TEST_CASE("heartbeats count only in the session, only rising, and only while linked") {
  Wearer wearer;
  wearer.link();
  const Bytes first = signed_packet(wearer.box.heartbeat(0, 0, wire::kLedFast));
  CHECK(wearer.hear(first) == Received::kHeartbeat);
  CHECK(wearer.pairing.led() == wire::kLedFast);
  CHECK(wearer.hear(wearer.box.heartbeat(0, 0, wire::kLedSlow)) == Received::kHeartbeat);
  CHECK(wearer.hear(first) == Received::kNothing);
  CHECK(wearer.pairing.led() == wire::kLedSlow);
  BoxSide old = wearer.box;
  old.session ^= 1;
  CHECK(wearer.hear(old.heartbeat()) == Received::kNothing);
  CHECK(wearer.pairing.counts().replayed == 2);
  for (int i = 0; i < 8; ++i) {  // replays do not keep a link alive
    wearer.wait(kSecond / 2);
    wearer.hear(first);
  }
  CHECK_FALSE(wearer.pairing.is_linked());
  CHECK(wearer.hear(wearer.box.heartbeat()) == Received::kNothing);
  CHECK_FALSE(wearer.pairing.is_linked());
}

TEST_CASE("new settings: other key and device, sequences that go on, answers to old hellos refused") {
  Wearer wearer;
  wearer.link();
  wearer.read();
  wearer.pairing.begin(0x77777777, fakes::kOtherKey, kBoot);
  CHECK_FALSE(wearer.pairing.is_linked());
  CHECK(wearer.pairing.session() == 0);
  BoxSide box = wearer.box;
  box.device_id = 0x77777777;
  CHECK(wearer.hear(signed_packet(box.assignment(1), fakes::kOtherKey)) == Received::kNothing);
  wearer.wait(2000);
  REQUIRE(wearer.hellos(Lane::kWifi).size() == 1);
  CHECK(wearer.hellos(Lane::kWifi)[0].as<wire::Hello>().device_id == 0x77777777);
  CHECK(wearer.newest_hello() == 2);
  CHECK(wearer.hear(signed_packet(box.assignment(2), fakes::kOtherKey)) == Received::kAssignment);
}

TEST_CASE("without a device id it greets no box and trusts none, even with a key of zeros") {
  const uint8_t zeros[wire::kKeyBytes] = {};
  Wearer wearer;
  wearer.pairing.begin(0, zeros, kBoot);
  wearer.pairing.set_lane(Lane::kWifi, true);
  wearer.pairing.set_lane(Lane::kCable, true);
  wearer.wait(kSecond);
  CHECK(wearer.sent.empty());
  wearer.box.device_id = 0;
  CHECK(wearer.hear(signed_packet(wearer.box.assignment(0), zeros)) == Received::kNothing);
  CHECK(wearer.hear(signed_packet(wearer.box.call(), zeros)) == Received::kNothing);
  wearer.wait(kSecond);
  CHECK(wearer.sent.empty());
}

TEST_CASE("counters stop at their end") {
  Wearer wearer;
  for (int i = 0; i < 70'000; ++i) wearer.hear(Bytes{1, 2, 3});
  CHECK(wearer.pairing.counts().malformed == 65535);
}
