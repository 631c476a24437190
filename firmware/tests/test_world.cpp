// The models that stand in for the board: Wi-Fi that blocks and goes stale, flash, cable, watchdog, paths.
#include <doctest/doctest.h>

#include <cmath>
#include <string>

#include "board_model.h"
#include "flash_model.h"
#include "path.h"
#include "second.h"
#include "serial_model.h"
#include "wifi_model.h"

using namespace bunraku;

namespace {

const uint8_t kBytes[] = {1, 2, 3};

struct Air {
  VirtualClock clock;
  WifiModel wifi{clock, 7};
  Air() { wifi.set_network("stage", "secret"); }

  bool joins() { return wifi.join("stage", "secret"); }
  void link_up() {
    REQUIRE(joins());
    REQUIRE(wifi.open(2390));
  }
  void wait_until(uint64_t at_us) {
    if (at_us > clock.now_us()) clock.advance(at_us - clock.now_us());
  }
  bool receives() {
    uint8_t data[64];
    Address from;
    return wifi.receive(data, sizeof data, from) > 0;
  }
};

}  // namespace

TEST_CASE("joining takes its time, and then the socket has to be opened") {
  Air air;
  CHECK_FALSE(air.wifi.is_up());
  CHECK_FALSE(air.wifi.open(2390));
  CHECK(air.joins());
  CHECK(air.clock.now_us() >= air.wifi.conditions.join_us[0]);
  CHECK(air.clock.now_us() <= air.wifi.conditions.join_us[1]);
  CHECK(air.wifi.joined_at_us() == air.clock.now_us());
  CHECK_FALSE(air.wifi.send({1, 9750}, kBytes, sizeof kBytes));
  CHECK(air.wifi.counts.refused == 1);
  const uint64_t before_us = air.clock.now_us();
  CHECK(air.wifi.open(2390));
  CHECK(air.clock.now_us() > before_us);
  CHECK(air.wifi.send({1, 9750}, kBytes, sizeof kBytes));
}

TEST_CASE("a wrong password or an absent access point blocks to the end") {
  Air air;
  CHECK_FALSE(air.wifi.join("stage", "guess"));
  CHECK(air.clock.now_us() == 10 * kSecond);
  CHECK_FALSE(air.wifi.join("staging", "secret"));
  CHECK(air.clock.now_us() == 20 * kSecond);
  air.wifi.set_access_point(false, air.clock.now_us());
  CHECK_FALSE(air.joins());
  CHECK(air.clock.now_us() == 30 * kSecond);
  CHECK(air.wifi.counts.failed_joins == 3);
}

TEST_CASE("an access point that comes back while a join blocks is joined") {
  Air air;
  air.wifi.set_access_point(false, 0);
  air.wifi.set_access_point(true, 4 * kSecond);
  CHECK(air.joins());
  CHECK(air.clock.now_us() > 4 * kSecond);
  CHECK(air.clock.now_us() < 7 * kSecond);
}

TEST_CASE("when the access point has gone the status is stale, what is sent is lost, the socket closes") {
  Air air;
  air.wifi.conditions.stale_us[0] = air.wifi.conditions.stale_us[1] = 3'000'000;
  air.link_up();
  const uint64_t gone_us = air.clock.now_us() + kSecond;
  air.wifi.set_access_point(false, gone_us);
  CHECK(air.wifi.is_carrying());
  air.wait_until(gone_us + 2 * kSecond);
  CHECK(air.wifi.is_up());
  CHECK_FALSE(air.wifi.is_carrying());
  CHECK(air.wifi.send({1, 9750}, kBytes, sizeof kBytes));
  Datagram taken;
  CHECK_FALSE(air.wifi.take(taken));
  CHECK(air.wifi.counts.lost == 1);
  air.wait_until(gone_us + 3 * kSecond);
  CHECK_FALSE(air.wifi.is_up());
  CHECK_FALSE(air.wifi.send({1, 9750}, kBytes, sizeof kBytes));
  air.wifi.set_access_point(true, air.clock.now_us());
  CHECK_FALSE(air.wifi.is_up());  // it does not join by itself
  air.link_up();
  CHECK(air.wifi.is_carrying());
}

TEST_CASE("an access point that was away for a moment has forgotten the wearable") {
  Air air;
  air.link_up();
  const uint64_t gone_us = air.clock.now_us();
  air.wifi.set_access_point(false, gone_us + 1);
  air.wifi.set_access_point(true, gone_us + 2);
  air.wait_until(gone_us + kSecond);
  CHECK(air.wifi.is_up());
  CHECK_FALSE(air.wifi.is_carrying());
  CHECK_FALSE(air.wifi.deliver({0, {1, 9750}, {1}}));
}

TEST_CASE("datagrams keep their order, bytes and sender") {
  Air air;
  CHECK_FALSE(air.wifi.deliver({0, {1, 9750}, {1}}));
  air.link_up();
  CHECK(air.wifi.deliver({0, {1, 9750}, {1, 2}}));
  CHECK(air.wifi.deliver({0, {5, 77}, {3}}));
  uint8_t data[64];
  Address from;
  CHECK(air.wifi.receive(data, sizeof data, from) == 2);
  CHECK(data[1] == 2);
  CHECK(from.ip == 1);
  CHECK(air.wifi.receive(data, sizeof data, from) == 1);
  CHECK(from.port == 77);
  CHECK(air.wifi.receive(data, sizeof data, from) == 0);
  CHECK(air.wifi.broadcast(9750, kBytes, sizeof kBytes));
  Datagram sent;
  CHECK(air.wifi.take(sent));
  CHECK(sent.address.ip == kBroadcast);
  CHECK(sent.address.port == 9750);
  CHECK(sent.data == std::vector<uint8_t>{1, 2, 3});
  CHECK(sent.at_us == air.clock.now_us());
}

TEST_CASE("leaving closes the socket and forgets what waits") {
  Air air;
  air.link_up();
  CHECK(air.wifi.deliver({0, {1, 9750}, {1}}));
  air.wifi.leave();
  air.link_up();
  CHECK_FALSE(air.receives());
}

TEST_CASE("the radio queue is bounded") {
  Air air;
  air.link_up();
  int taken = 0;
  while (air.wifi.deliver({0, {1, 9750}, {1}})) ++taken;
  CHECK(taken == 16);
  CHECK(air.receives());
  CHECK(air.wifi.deliver({0, {1, 9750}, {1}}));
}

TEST_CASE("loss and refusals come as often as asked, the same for the same seed") {
  uint32_t lost[2], refused[2];
  for (int run = 0; run < 2; ++run) {
    Air air;
    air.link_up();
    air.wifi.conditions.loss = 0.1;
    air.wifi.conditions.send_failures = 0.2;
    for (int each = 0; each < 1000; ++each) air.wifi.send({1, 9750}, kBytes, sizeof kBytes);
    lost[run] = air.wifi.counts.lost;
    refused[run] = air.wifi.counts.refused;
  }
  CHECK(lost[0] > 50);
  CHECK(lost[0] < 120);
  CHECK(refused[0] > 150);
  CHECK(refused[0] < 250);
  CHECK(lost[0] == lost[1]);
  CHECK(refused[0] == refused[1]);
}

TEST_CASE("flash keeps records as an image, and can fail or tear") {
  VirtualClock clock;
  FlashModel flash(clock);
  uint8_t read[3] = {};
  CHECK_FALSE(flash.load(1, read, 3));
  CHECK(flash.save(1, kBytes, 3));
  CHECK(clock.now_us() > 0);
  CHECK(flash.save(9, kBytes, 1));
  FlashModel other(clock);
  const std::vector<uint8_t> image = flash.image();
  CHECK_FALSE(other.use_image(image.data(), image.size() - 1));
  CHECK_FALSE(other.load(1, read, 3));
  CHECK(other.use_image(image.data(), image.size()));
  CHECK(other.load(1, read, 3));
  CHECK(read[2] == 3);
  CHECK_FALSE(other.load(9, read, 3));
  flash.fails = true;
  CHECK_FALSE(flash.save(1, kBytes + 1, 2));
  CHECK(flash.load(1, read, 3));
  flash.fails = false;
  flash.tears_next = true;
  CHECK_FALSE(flash.save(1, kBytes, 3));
  CHECK(flash.load(1, read, 3));
  CHECK(read[0] == 1);
  CHECK(read[2] == 0xFF);
  flash.erase();
  CHECK_FALSE(flash.load(1, read, 3));
}

TEST_CASE("the cable carries bytes both ways while the host has it open") {
  SerialModel line;
  uint8_t read[8];
  CHECK(line.put(kBytes, 3) == 0);
  CHECK(line.write(kBytes, 3) == 0);
  line.connect(true);
  CHECK(line.put(kBytes, 3) == 3);
  CHECK(line.read(read, 2) == 2);
  CHECK(line.read(read, 8) == 1);
  CHECK(read[0] == 3);
  int written = 0;
  while (line.write(kBytes, 3) == 3) written += 3;
  CHECK(written <= 512);
  line.connect(false);
  CHECK(line.take(read, 8) == 0);
}

TEST_CASE("the watchdog notices the longest wait and bites after 16 seconds") {
  VirtualClock clock;
  BoardModel board(clock, 1);
  board.power_on();
  clock.advance(12 * kSecond);
  board.feed_watchdog();
  CHECK(board.longest_unfed_us == 12 * kSecond);
  CHECK_FALSE(board.has_bitten());
  clock.advance(17 * kSecond);
  board.notice();
  CHECK(board.has_bitten());
  board.power_on();
  CHECK_FALSE(board.has_bitten());
}

TEST_CASE("the board's clock starts at power-on and drifts") {
  VirtualClock clock;
  clock.advance(100 * kSecond);
  BoardClock board(clock);
  board.drift_ppm = 100;
  board.power_on(0);
  clock.advance(10 * kSecond);
  CHECK(board.micros() == 10'001'000);
  board.power_on(0xFFFFFFFFu);
  clock.advance(2);
  CHECK(board.micros() == 1);
}

TEST_CASE("a path turns evenly, the short way, and stays at its end") {
  Path path;
  path.stand({1, 0, 0, 0});
  const double half = std::sqrt(0.5);
  path.go_to({1, 0, 0, 0}, 1000);
  path.go_to({-half, 0, 0, -half}, 2000);  // a quarter turn about z, with the other sign
  CHECK(path.at(500)[0] == doctest::Approx(1));
  CHECK(2 * std::acos(path.at(1500)[0]) == doctest::Approx(0.25 * std::acos(-1.0)));
  CHECK(std::abs(path.at(9000)[3]) == doctest::Approx(half));
  path.go_to({1, 0, 0, 0}, 1500);  // a new order: what was to follow is dropped
  CHECK(path.at(9000)[0] == doctest::Approx(1));
}
