// Double taps, and what must not be taken for one.
#include <doctest/doctest.h>

#include <cstdint>
#include <initializer_list>

#include "taps.h"

using namespace bunraku;

namespace {

struct Hand {
  Taps taps;
  uint32_t now_us = 0xFFFFFFFFu - 2'000'000;  // the clock wraps on the way
  int found = 0;

  void feel(int16_t acceleration, uint32_t ms) {
    for (uint32_t spent = 0; spent < ms; spent += 10) {
      now_us += 10'000;
      const int16_t linear[3] = {static_cast<int16_t>(acceleration / 2), acceleration, 0};
      if (taps.feed(linear, now_us)) ++found;
    }
  }
  void rest(uint32_t ms) { feel(40, ms); }
  void tap() {
    feel(2200, 20);
    feel(-700, 20);
    feel(400, 10);
  }
};

}  // namespace

TEST_CASE("a double tap at rest is found once, at any pace that a hand has") {
  for (const uint32_t between_ms : {60, 100, 200, 400}) {  // after the first one's 50 ms
    Hand hand;
    hand.rest(600);
    hand.tap();
    hand.rest(between_ms);
    hand.tap();
    CHECK(hand.found == 0);
    hand.rest(600);
    CHECK(hand.found == 1);
    hand.rest(2000);
    CHECK(hand.found == 1);
  }
}

TEST_CASE("a single one, three, or two too far apart are none") {
  Hand single;
  single.rest(600);
  single.tap();
  single.rest(2000);
  CHECK(single.found == 0);

  Hand three;
  three.rest(600);
  for (int i = 0; i < 3; ++i) {
    three.tap();
    three.rest(150);
  }
  three.rest(2000);
  CHECK(three.found == 0);

  Hand slow;
  slow.rest(600);
  slow.tap();
  slow.rest(700);
  slow.tap();
  slow.rest(2000);
  CHECK(slow.found == 0);
}

TEST_CASE("after a single tap, a double tap is found") {
  Hand hand;
  hand.rest(600);
  hand.tap();
  hand.rest(900);
  hand.tap();
  hand.rest(150);
  hand.tap();
  hand.rest(500);
  CHECK(hand.found == 1);
}

TEST_CASE("dancing before or after makes it none") {
  for (const bool is_before : {true, false}) {
    Hand hand;
    hand.rest(600);
    if (is_before) hand.feel(900, 500), hand.rest(100);
    hand.tap();
    hand.rest(150);
    hand.tap();
    if (!is_before) hand.rest(100), hand.feel(900, 500);
    hand.rest(2000);
    CHECK(hand.found == 0);
  }
}

TEST_CASE("a long shove is no tap, and neither is a soft knock") {
  Hand shove;
  shove.rest(600);
  shove.feel(2000, 200);
  shove.rest(150);
  shove.feel(2000, 200);
  shove.rest(1000);
  CHECK(shove.found == 0);

  Hand soft;
  soft.rest(600);
  for (int i = 0; i < 2; ++i) soft.feel(600, 30), soft.rest(150);
  soft.rest(1000);
  CHECK(soft.found == 0);
}

TEST_CASE("a gap in the samples starts it over") {
  Hand hand;
  hand.rest(600);
  hand.tap();
  hand.now_us += 200'000;
  hand.tap();
  hand.rest(1000);
  CHECK(hand.found == 0);
}

TEST_CASE("a swinging arm is never a double tap") {
  Hand hand;
  uint32_t noise = 1;
  for (int i = 0; i < 60'000; ++i) {  // ten minutes; swings of 0.6 to 1.2 s, up to 3 g
    noise = noise * 1664525 + 1013904223;
    const int phase = i % (60 + static_cast<int>(noise >> 28) * 4);
    hand.feel(static_cast<int16_t>(phase < 30 ? phase * 100 : 250 + (noise >> 24)), 10);
  }
  CHECK(hand.found == 0);
}

TEST_CASE("the largest values do not overflow") {
  Hand hand;
  hand.rest(600);
  for (int i = 0; i < 2; ++i) {
    const int16_t most[3] = {INT16_MIN, INT16_MIN, INT16_MIN};
    hand.now_us += 10'000;
    CHECK_FALSE(hand.taps.feed(most, hand.now_us));
    hand.rest(150);
  }
  hand.rest(500);
  CHECK(hand.found == 1);
}
