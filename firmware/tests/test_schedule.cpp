// The grid of slots: steady, across the clock's wrap, and after stalls.
#include <doctest/doctest.h>

#include <initializer_list>

#include "random.h"
#include "schedule.h"

using bunraku::Random;
using bunraku::Schedule;

TEST_CASE("slots come on an absolute grid, however late each one is noticed") {
  Schedule schedule;
  Random random(1);
  schedule.start(5000, 20000);
  uint32_t now_us = 5000, slots = 0;
  while (now_us < 5000 + 100 * 20000) {
    if (schedule.is_due(now_us)) {
      CHECK((schedule.next_us() - 5000) % 20000 == 0);
      ++slots;
    }
    now_us += static_cast<uint32_t>(random.between(1, 9000));
  }
  CHECK(slots == 100);
  CHECK(schedule.skipped() == 0);
}

TEST_CASE("the wrap of the microsecond clock is no event") {
  for (uint64_t seed = 1; seed <= 50; ++seed) {
    Random random(seed);
    const uint64_t begun_us = 0x100000000u - random.between(0, 2000000);
    const uint32_t period_us = static_cast<uint32_t>(random.between(5000, 40000));
    Schedule schedule;
    schedule.start(static_cast<uint32_t>(begun_us), period_us);
    uint32_t slots = 0;
    for (uint64_t now_us = begun_us; now_us < begun_us + 200u * period_us;) {
      if (schedule.is_due(static_cast<uint32_t>(now_us))) ++slots;
      now_us += random.between(1, 2000);
    }
    CHECK(slots == 200);
    CHECK(schedule.skipped() == 0);
  }
}

TEST_CASE("after a stall the missed slots are skipped and counted, never run in a burst") {
  for (const uint64_t stall_us : {19999ull, 20000ull, 90000ull, 10000000ull, 2147483648ull, 4000000000ull}) {
    CAPTURE(stall_us);
    Schedule schedule;
    const uint64_t begun_us = 0xFFFFF000u;
    schedule.start(static_cast<uint32_t>(begun_us), 20000);
    CHECK(schedule.is_due(static_cast<uint32_t>(begun_us)));
    uint64_t now_us = begun_us + stall_us + 1;
    uint32_t slots = 0;
    CHECK(schedule.is_due(static_cast<uint32_t>(now_us)) == (stall_us >= 19999));
    for (const uint64_t end_us = now_us + 200010; now_us < end_us; now_us += 10) {
      if (schedule.is_due(static_cast<uint32_t>(now_us))) ++slots;
    }
    CHECK(slots == 10);
    CHECK(schedule.skipped() == (stall_us + 1) / 20000 - 1);
  }
}

TEST_CASE("each slot is given once") {
  Schedule schedule;
  schedule.start(0, 1000);
  CHECK(schedule.is_due(0));
  CHECK_FALSE(schedule.is_due(0));
  CHECK_FALSE(schedule.is_due(999));
  CHECK(schedule.is_due(1000));
  CHECK_FALSE(schedule.is_due(1000));
}
