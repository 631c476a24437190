// Pairing on invented times: greeting, assignment, loss, roaming, and every sender that must not be trusted.
#include <doctest/doctest.h>

#include <cstring>
#include <vector>

#include "box_side.h"
#include "fakes.h"
#include "pairing.h"

using namespace bunraku;
using fakes::BoxSide;
using fakes::Bytes;
using fakes::signed_packet;

namespace {

constexpr uint32_t kSecond = 1'000'000;
constexpr uint32_t kBoot = 0xB0071234;
const Way kBoxOnWifi = {Lane::kWifi, false, {0xC0A80401, 9750}};
const Way kStranger = {Lane::kWifi, false, {0xC0A80466, 6666}};
const Way kCable = {Lane::kCable, false, {0, 0}};

struct Sent {
  uint32_t at_us;
  Way to;
  Bytes data;
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
  BoxSide box;
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
      sent.push_back({now_us, to, Bytes(packet, packet + count)});
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
  Received hear(const Bytes& data, const Way& from = kBoxOnWifi) {
    return pairing.receive(data.data(), static_cast<uint16_t>(data.size()), from, condition, now_us);
  }
  template <typename Packet>
  Received hear(const Packet& packet, const Way& from = kBoxOnWifi) {
    return hear(signed_packet(packet), from);
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
    CHECK(fakes::is_signed(Bytes(packet, packet + count)));
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

}  // namespace

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

TEST_CASE("greets on both lanes until it is answered") {
  Wearer wearer;
  wearer.pairing.set_lane(Lane::kWifi, true);
  wearer.pairing.set_lane(Lane::kCable, true);
  wearer.wait(900'000);
  CHECK(wearer.hellos(Lane::kWifi).size() == 2);
  CHECK(wearer.hellos(Lane::kCable).size() == 2);
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
  CHECK(wearer.hear(wearer.box.heartbeat()) == Received::kNothing);  // of the old session
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

TEST_CASE("a saved calibration is told three times, a second apart, once linked") {
  Wearer wearer;
  uint8_t offsets[22] = {1, 2, 3};
  wearer.pairing.announce_profile(offsets);
  wearer.pairing.set_lane(Lane::kWifi, true);
  wearer.wait(2 * kSecond);
  CHECK(wearer.of(wire::Profile::kKind, Lane::kWifi).empty());
  wearer.link();
  wearer.dance(6);
  const auto profiles = wearer.of(wire::Profile::kKind, Lane::kWifi);
  REQUIRE(profiles.size() == 3);
  CHECK(profiles[1].at_us - profiles[0].at_us == kSecond);
  for (uint32_t i = 0; i < 3; ++i) {
    const auto profile = profiles[i].as<wire::Profile>();
    CHECK(profile.sequence == i + 1);
    CHECK(profile.session == wearer.box.session);
    CHECK(memcmp(profile.offsets, offsets, 22) == 0);
    CHECK(memcmp(profile.imu_id, wearer.condition.imu_id, 16) == 0);
    CHECK(fakes::is_signed(profiles[i].data));
  }
}

TEST_CASE("a calibration kept by the box is taken within 10 s of the assignment, once, by its own IMU") {
  Wearer wearer;
  wearer.link();
  uint8_t other_imu[16] = {9};
  CHECK(wearer.hear(wearer.box.restore(other_imu)) == Received::kNothing);
  const Bytes restore = signed_packet(wearer.box.restore(wearer.condition.imu_id));
  CHECK(wearer.hear(restore) == Received::kRestore);
  CHECK(wearer.hear(restore) == Received::kNothing);
  BoxSide old = wearer.box;
  old.session ^= 1;
  CHECK(wearer.hear(old.restore(wearer.condition.imu_id)) == Received::kNothing);
  wearer.dance(9);
  CHECK(wearer.hear(wearer.box.restore(wearer.condition.imu_id)) == Received::kRestore);
  wearer.dance(1);
  CHECK(wearer.hear(wearer.box.restore(wearer.condition.imu_id)) == Received::kNothing);
}

TEST_CASE("a wearable that has a calibration keeps it") {
  Wearer wearer;
  wearer.link();
  wearer.condition.flags = wire::kHasProfile;
  CHECK(wearer.hear(wearer.box.restore(wearer.condition.imu_id)) == Received::kNothing);
}

TEST_CASE("an unlinked wearable takes no calibration") {
  Wearer wearer;
  wearer.link();
  wearer.wait(3'100'000);
  CHECK(wearer.hear(wearer.box.restore(wearer.condition.imu_id)) == Received::kNothing);
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

TEST_CASE("counters stop at their end") {
  Wearer wearer;
  for (int i = 0; i < 70'000; ++i) wearer.hear(Bytes{1, 2, 3});
  CHECK(wearer.pairing.counts().malformed == 65535);
}
