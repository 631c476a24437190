// The driver on the simulated chip, in virtual time: start-up, settings, its pace, and every wait kept.
#include <doctest/doctest.h>

#include <string.h>

#include <initializer_list>

#include "bno055_registers.h"
#include "imu_rig.h"

namespace bunraku {

TEST_CASE("from power-on to the first reading") {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    ImuRig rig(seed, seed % 2 == 0 ? 0xFFFFFFFFu - 100000 * seed : 1000);  // some across the clock's wrap
    rig.model.set_motion(dance);
    rig.power_on();
    const double seconds = rig.run_until_reading();
    CHECK(seconds < 0.60);
    CHECK(rig.imu.is_running());
    CHECK(rig.model.counts().start_up_accesses == 1);  // one look whether the chip was there before the board
    REQUIRE(rig.imu.has_id());
    CHECK(memcmp(rig.imu.unique_id(), rig.model.unique_id().data(), 16) == 0);
    CHECK(rig.imu.recoveries() == 0);
    CHECK(rig.model.counts().resets == 0);
    CHECK(rig.model.peek(bno055::kUnits) == bno055::kMetric);
    rig.check_manners();
  }
}

TEST_CASE("50 readings and 100 accelerations a second, calibration at its pace") {
  ImuRig rig;
  rig.model.set_motion(dance);
  rig.power_on();
  rig.run_until_reading();
  const uint32_t readings = rig.readings, accelerations = rig.accelerations;
  rig.longest_gap_us = rig.latest_us = 0;
  rig.run(20);
  CHECK(rig.readings - readings >= 999);
  CHECK(rig.accelerations - accelerations >= 1900);
  CHECK(rig.schedule.skipped() == 0);
  CHECK(rig.longest_gap_us < 21000);
  CHECK(rig.latest_us < 1000);
  CHECK(rig.imu.is_calibrated());
  CHECK(rig.sample.calibration == 0x3C);
  CHECK(rig.imu.counts().bus_errors <= 2);
  CHECK(rig.imu.recoveries() == 0);
  rig.check_manners();
}

TEST_CASE("other rates keep their places too: 25 Hz, 100 Hz") {
  for (const uint32_t period_us : {40000u, 10000u}) {
    ImuRig rig;
    rig.model.set_motion(dance);
    rig.power_on();
    rig.run_until_reading();
    rig.schedule.start(rig.clock.micros(), period_us);
    rig.run(0.1);
    rig.latest_us = 0;
    const uint32_t readings = rig.readings, accelerations = rig.accelerations;
    rig.run(10);
    CHECK(rig.readings - readings >= 10000000 / period_us - 1);
    CHECK(rig.latest_us < 1000);  // looks after the chip and for taps do not delay a sample
    CHECK(rig.accelerations - accelerations >= 750);
    CHECK(rig.imu.is_calibrated());
    rig.check_manners();
  }
}

TEST_CASE("a knock reaches the taps") {
  ImuRig rig;
  rig.power_on();
  rig.run(2);
  CHECK(rig.hardest < 10);
  rig.model.tap(rig.clock.now_us() + 3000, 30);
  rig.run(0.1);
  CHECK(rig.hardest > 2000);
}

TEST_CASE("the board restarts, the chip does not: it goes on, heading kept, whatever page was selected") {
  for (const bool is_on_page_1 : {false, true}) {
    ImuRig rig;
    rig.model.set_motion(dance);
    rig.power_on();
    rig.run(3);
    if (is_on_page_1) {
      const uint8_t page = 1;
      rig.model.write(0x28, bno055::kPageId, &page, 1);
    }
    Bno055 restarted(rig.model);
    const Offsets profile;
    restarted.start(ImuRig::kPlain, rig.clock.micros());
    const uint64_t begun_us = rig.clock.now_us();
    while (!restarted.is_running() && rig.clock.now_us() < begun_us + 1000000) {
      restarted.step(rig.clock.micros());
      if (restarted.has_id()) restarted.use_profile(profile.bytes);  // it is kept by this id
      rig.clock.advance(700);
    }
    CHECK(restarted.is_running());
    CHECK(rig.clock.now_us() - begun_us < 60000);
    for (int i = 0; i < 100; ++i) restarted.step(rig.clock.micros());
    CHECK(restarted.has_id());
    CHECK(restarted.has_profile());
    CHECK(restarted.recoveries() == 0);
    CHECK(rig.model.counts().fusion_starts == 1);
  }
}

TEST_CASE("other settings are another fusion; the same settings are not") {
  ImuRig rig;
  rig.model.set_motion(dance);
  rig.power_on();
  rig.run(2);
  rig.power_on(ImuRig::kPlain);
  rig.run(1);
  CHECK(rig.model.counts().fusion_starts == 1);
  rig.power_on({Fusion::kNdof, 0x21, 0x04, true});
  rig.run(1);
  CHECK(rig.model.counts().fusion_starts == 2);
  CHECK(rig.imu.recoveries() == 1);
  CHECK(rig.model.peek(bno055::kMode) == 0x0C);
  CHECK(rig.model.peek(bno055::kAxisMap) == 0x21);
  CHECK(rig.model.peek(bno055::kAxisSign) == 0x04);
  CHECK(rig.model.peek(bno055::kTrigger) == 0x80);
  rig.check_manners();
}

TEST_CASE("an axis remap that is none leaves the axes as they are") {
  int remaps = 0;
  for (int map = 0; map < 256; ++map) {
    for (int sign = 0; sign < 256; ++sign) {
      remaps += is_axis_remap(static_cast<uint8_t>(map), static_cast<uint8_t>(sign)) ? 1 : 0;
    }
  }
  CHECK(remaps == 24);
  ImuRig rig;
  rig.power_on({Fusion::kImuPlus, 0x00, 0x00});
  CHECK(rig.run_until_reading() < 1);
  CHECK(rig.model.peek(bno055::kAxisMap) == 0x24);
  rig.check_manners();
}

TEST_CASE("all 24 remaps are taken, and fusion stays right") {
  for (uint8_t map = 0; map < 0x40; ++map) {
    for (uint8_t sign = 0; sign < 8; ++sign) {
      if (!is_axis_remap(map, sign)) continue;
      ImuRig rig;
      rig.model.set_motion(dance);
      rig.power_on({Fusion::kImuPlus, map, sign});
      rig.run(1);
      CHECK(rig.readings > 10);
      CHECK(rig.model.peek(bno055::kAxisMap) == map);
      CHECK(rig.model.peek(bno055::kAxisSign) == sign);
      rig.check_manners();
    }
  }
}

TEST_CASE("the other address is found as well") {
  VirtualClock clock(5);
  Bno055Model model(clock, 3, 0x29);
  Bno055 imu(model);
  imu.start(ImuRig::kPlain, clock.micros());
  while (!imu.is_running() && clock.now_us() < 2000000) {
    imu.step(clock.micros());
    clock.advance(700);
  }
  CHECK(imu.is_running());
}

TEST_CASE("a loop that stalls, or a bus that stretches much more, breaks no wait") {
  for (const uint32_t loop_us : {50u, 5000u, 60000u}) {
    ImuRig rig;
    rig.model.set_motion(dance);
    rig.power_on();
    rig.run(5, loop_us);
    const Offsets profile;
    rig.imu.use_profile(profile.bytes);
    rig.run(2, loop_us);
    rig.imu.save_profile();
    rig.run(2, loop_us);
    CHECK(rig.imu.is_running());
    CHECK(rig.imu.recoveries() == 2);
    rig.check_manners();
  }
  ImuRig rig;
  rig.model.stretch_us_byte = 1000;
  rig.power_on();
  rig.run(5);
  CHECK(rig.imu.is_running());
  CHECK(rig.model.counts().early_accesses == 0);
}

}  // namespace bunraku
