// The battery's percentage.
#include <doctest/doctest.h>

#include <initializer_list>

#include "battery.h"

using namespace bunraku;

namespace {

uint8_t percent_at(uint16_t millivolts) {
  Battery battery;
  battery.measure(millivolts);
  return battery.percent();
}

}  // namespace

TEST_CASE("full, empty, unknown, and never rising while the cell falls") {
  CHECK(percent_at(4200) == 100);
  CHECK(percent_at(5000) == 100);
  CHECK(percent_at(3300) == 0);
  CHECK(percent_at(1) == 0);
  CHECK(percent_at(0) == 255);
  CHECK(Battery().percent() == 255);
  uint8_t before = 100;
  for (uint16_t millivolts = 4300; millivolts >= 3200; --millivolts) {
    CHECK(percent_at(millivolts) <= before);
    CHECK(before - percent_at(millivolts) <= 1);
    before = percent_at(millivolts);
  }
  CHECK(before == 0);
}

TEST_CASE("half of the charge is left at about 3.85 V") {
  CHECK(percent_at(3850) >= 45);
  CHECK(percent_at(3850) <= 55);
}

TEST_CASE("one low measurement while the radio sends is smoothed away") {
  Battery battery;
  battery.measure(3900);
  const uint8_t before = battery.percent();
  battery.measure(3500);
  CHECK(before - battery.percent() <= 20);
  CHECK_FALSE(battery.is_low());
  for (int i = 0; i < 60; ++i) battery.measure(3500);
  CHECK(battery.millivolts() <= 3510);
  CHECK(battery.is_low());
}

TEST_CASE("low does not flicker at its limit") {
  Battery battery;
  for (int i = 0; i < 60; ++i) battery.measure(3700);  // 13 %
  REQUIRE(battery.is_low());
  for (int i = 0; i < 60; ++i) battery.measure(3730);  // 18 %
  CHECK(battery.is_low());
  for (int i = 0; i < 60; ++i) battery.measure(3790);
  CHECK_FALSE(battery.is_low());
}

TEST_CASE("unknown is never low") {
  Battery battery;
  battery.measure(0);
  CHECK_FALSE(battery.is_low());
}
