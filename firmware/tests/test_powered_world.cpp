// The whole wearable in its world: power, restarts, calls that block, trouble by name.
#include <doctest/doctest.h>

#include <string>

#include "second.h"
#include "trouble.h"
#include "world.h"

using namespace bunraku;

namespace {

// Types a line into the console and gives the answer.
std::string ask(World& world, const std::string& line) {
  const std::string typed = line + "\n";
  world.serial.put(reinterpret_cast<const uint8_t*>(typed.data()), static_cast<uint16_t>(typed.size()));
  world.step_until(world.clock.now_us() + kSecond / 2);
  uint8_t data[512];
  const uint16_t count = world.serial.take(data, sizeof data);
  const std::string said(data, data + count);
  const size_t begin = said.find_first_of("oe");  // packets of hellos may come before
  return begin == std::string::npos ? "" : said.substr(begin, said.find('\r', begin) - begin);
}

// A wearable that has its settings, switched off, out of reach of any network.
struct Provisioned {
  World world{5, 0};
  Provisioned() {
    world.wifi.set_network("stage", "curtain up");
    world.wifi.set_access_point(false, 0);
    world.power(true);
    world.serial.connect(true);
    for (const char* line : {"set device 00000007", "set key 000102030405060708090a0b0c0d0e0f",
                             "set network stage", "set password curtain up"})
      REQUIRE(ask(world, line) == "ok");
    REQUIRE(ask(world, "save") == "ok saved");
    world.serial.connect(false);
    world.power(false);
  }
  uint64_t now() const { return world.clock.now_us(); }
};

}  // namespace

TEST_CASE("a world begins switched off, and time passes all the same") {
  World world(1, 7 * kSecond);
  CHECK_FALSE(world.is_on());
  world.step_until(9 * kSecond);
  CHECK(world.clock.now_us() == 9 * kSecond);
  CHECK_FALSE(world.led.is_on());
}

TEST_CASE("settings survive power-off, all else starts over") {
  Provisioned wearable;
  wearable.world.power(true);
  const uint32_t first = wearable.world.status().boot_nonce;
  wearable.world.power(false);
  wearable.world.power(true);
  CHECK(wearable.world.status().state != State::kNotProvisioned);
  CHECK(wearable.world.status().boot_nonce != first);
  CHECK(wearable.world.counts.power_ons == 3);
  CHECK(wearable.world.board_clock.micros() < kSecond);
}

TEST_CASE("an upload of new firmware erases the settings") {
  Provisioned wearable;
  wearable.world.flash.erase();
  wearable.world.power(true);
  CHECK(wearable.world.status().state == State::kNotProvisioned);
}

TEST_CASE("the console's restart is a new power-on for the firmware, not for the IMU") {
  Provisioned wearable;
  World& world = wearable.world;
  world.power(true);
  world.serial.connect(true);
  world.step_until(wearable.now() + 3 * kSecond);
  const uint32_t nonce = world.status().boot_nonce;
  CHECK(ask(world, "restart").find("ok") == 0);
  world.step_until(wearable.now() + kSecond);
  CHECK(world.counts.restarts == 1);
  CHECK(world.counts.power_ons == 2);
  CHECK(world.status().boot_nonce != nonce);
}

TEST_CASE("while joining blocks the status says so, and the watchdog lives through it") {
  Provisioned wearable;
  World& world = wearable.world;
  world.power(true);
  world.step_until(wearable.now() + 5 * kSecond);
  REQUIRE(world.wifi.counts.failed_joins == 1);  // told at its end, which is later than what was asked for
  CHECK(world.status().state == State::kJoining);
  world.step_until(wearable.now() + 60 * kSecond);
  CHECK(world.wifi.counts.failed_joins >= 5);
  CHECK(world.counts.watchdog_bites == 0);
  CHECK(world.board.longest_unfed_us >= 10 * kSecond);
  CHECK(world.board.longest_unfed_us < BoardModel::kWatchdogUs);
}

TEST_CASE("a dead radio hangs each join, and the console is reached all the same") {
  Provisioned wearable;
  World& world = wearable.world;
  REQUIRE(set_trouble(world, "dead radio", 1));
  world.power(true);
  world.step_until(wearable.now() + 3 * kSecond);
  REQUIRE(world.counts.watchdog_bites == 1);  // USB is enumerated by now, and the port was not open
  world.step_until(world.booted_at_us() + 5 * kSecond);
  world.serial.connect(true);
  CHECK(ask(world, "id").find("ok bunraku-wearable") == 0);
  world.step_until(wearable.now() + 120 * kSecond);
  uint8_t stale[512];
  while (world.serial.take(stale, sizeof stale) > 0) continue;
  ask(world, "id");  // no hellos from now on
  CHECK(ask(world, "status").find("ok state ") == 0);
  CHECK(world.counts.watchdog_bites == 1);
  world.serial.connect(false);
  world.step_until(wearable.now() + 30 * kSecond);  // without a cable it tries the radio again, and again
  CHECK(world.counts.watchdog_bites >= 2);
  REQUIRE(set_trouble(world, "dead radio", 0));
  world.wifi.set_access_point(true, wearable.now());
  world.step_until(wearable.now() + 30 * kSecond);
  CHECK(world.wifi.counts.joins >= 1);
}

TEST_CASE("power that goes while a call blocks goes then, and not at its end") {
  Provisioned wearable;
  World& world = wearable.world;
  world.wifi.set_access_point(true, wearable.now());
  world.power(true);
  LedTrace::Change change;
  while (world.led.take(change)) continue;
  const uint64_t cut_us = wearable.now() + kSecond / 2;
  world.step_until(cut_us);
  REQUIRE(world.wifi.is_joining(cut_us));
  world.power(false);
  CHECK(world.clock.now_us() == cut_us);
  CHECK_FALSE(world.led.is_on());
  while (world.led.take(change)) CHECK(change.at_us <= cut_us);
  Datagram sent;
  CHECK_FALSE(world.wifi.take(sent));
  world.power(true);
  world.step_until(wearable.now() + 10 * kSecond);
  CHECK(world.wifi.take(sent));
  CHECK(sent.address.ip == kBroadcast);
}

TEST_CASE("the same seed gives the same world, another one another") {
  std::string said[3];
  for (int run = 0; run < 3; ++run) {
    World world(run < 2 ? 1 : 2, 0);
    world.power(true);
    world.serial.connect(true);
    world.step_until(3 * kSecond);
    said[run] = ask(world, "id");
  }
  CHECK(said[0].find("ok bunraku-wearable") == 0);
  CHECK(said[0] == said[1]);
  CHECK(said[0] != said[2]);  // another chip with another unique id
}

TEST_CASE("trouble has names, and what has none is refused") {
  World world(1, 0);
  CHECK(set_trouble(world, "loss", 0.25));
  CHECK(world.wifi.conditions.loss == 0.25);
  CHECK(set_trouble(world, "torn read", 0.5));
  CHECK(set_trouble(world, "heading drift", 3));
  CHECK(world.imu.drift_degrees_minute == 3);
  CHECK_FALSE(set_trouble(world, "rain", 1));
  for (const char* fault : {"nack", "stuck bus", "zero read", "torn read", "flipped bit", "brown-out",
                            "silent config", "frozen", "fusion error"})
    CHECK(inject(world, fault, 1));
  CHECK_FALSE(inject(world, "loss", 1));
}
