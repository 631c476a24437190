// The lamp's signals: flashes counted over time.
#include <doctest/doctest.h>

#include <initializer_list>

#include "led_pattern.h"

using namespace bunraku;

namespace {

struct Seen {
  int flashes = 0;
  int lit_ms = 0;
};

Seen watch(const LightCues& cues, uint32_t from_ms, uint32_t ms) {
  Seen seen;
  bool was_lit = is_lit(cues, from_ms + ms - 1);  // patterns repeat
  for (uint32_t at = 0; at < ms; ++at) {
    const bool now = is_lit(cues, from_ms + at);
    if (now) ++seen.lit_ms;
    if (now && !was_lit) ++seen.flashes;
    was_lit = now;
  }
  return seen;
}

LightCues linked(uint8_t box_led) { return {State::kLinked, box_led, false, false, false, false}; }
LightCues in(State state) { return {state, wire::kLedOff, false, false, false, false}; }

}  // namespace

TEST_CASE("each state has its own pattern") {
  CHECK(watch(in(State::kNotProvisioned), 0, 2000).flashes == 2);
  CHECK(watch(in(State::kJoining), 0, 1000).flashes == 5);
  CHECK(watch(in(State::kJoining), 0, 1000).lit_ms == 500);
  CHECK(watch(in(State::kGreeting), 0, 1000).flashes == 1);
  CHECK(watch(in(State::kGreeting), 0, 1000).lit_ms == 500);
}

TEST_CASE("linked, the box says what") {
  CHECK(watch(linked(wire::kLedOff), 0, 60'000).lit_ms == 0);
  CHECK(watch(linked(wire::kLedOn), 0, 3000).flashes == 1);
  CHECK(watch(linked(wire::kLedOn), 0, 3000).lit_ms == 60);
  CHECK(watch(linked(wire::kLedSlow), 0, 1000).flashes == 1);
  CHECK(watch(linked(wire::kLedSlow), 0, 1000).lit_ms == 500);
  CHECK(watch(linked(wire::kLedFast), 0, 1000).flashes == 5);
  CHECK(watch(linked(wire::kLedStrobe), 0, 1000).flashes == 10);
  CHECK(watch(linked(200), 0, 10'000).lit_ms == 0);  // a box of tomorrow
}

TEST_CASE("what the box said last counts only while linked") {
  LightCues cues = in(State::kGreeting);
  cues.box_led = wire::kLedStrobe;
  CHECK(watch(cues, 0, 1000).flashes == 1);
}

TEST_CASE("a strobe from the console is seen in every state") {
  for (const State state : {State::kNotProvisioned, State::kJoining, State::kGreeting, State::kLinked}) {
    LightCues cues = in(state);
    cues.is_strobing = cues.has_imu_failed = cues.is_battery_low = true;
    CHECK(watch(cues, 0, 1000).flashes == 10);
  }
}

TEST_CASE("no IMU: five flashes and a pause") {
  LightCues cues = linked(wire::kLedOn);
  cues.has_imu_failed = true;
  CHECK(watch(cues, 0, 2500).flashes == 5);
  cues.state = State::kNotProvisioned;
  CHECK(watch(cues, 0, 2000).flashes == 2);
}

TEST_CASE("a low battery shows over quiet patterns, not over what the box wants seen") {
  for (const uint8_t led : {wire::kLedOff, wire::kLedOn}) {
    LightCues cues = linked(led);
    cues.is_battery_low = true;
    CHECK(watch(cues, 0, 1000).flashes == 3);
    CHECK(watch(cues, 4000, 1000).flashes == 3);
  }
  LightCues cues = linked(wire::kLedOff);
  cues.is_battery_low = true;
  CHECK(watch(cues, 1000, 3000).flashes == 0);
  cues.box_led = wire::kLedSlow;
  CHECK(watch(cues, 0, 4000).flashes == 4);
  LightCues searching = in(State::kGreeting);
  searching.is_battery_low = true;
  CHECK(watch(searching, 0, 1000).flashes == 3);
  CHECK(watch(searching, 1000, 3000).flashes == 3);
}

TEST_CASE("while something is saved the lamp is on") {
  LightCues cues = in(State::kNotProvisioned);
  cues.is_saving = cues.is_strobing = true;
  CHECK(watch(cues, 0, 5000).lit_ms == 5000);
}
