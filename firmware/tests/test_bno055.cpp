// The driver on the simulated chip, in virtual time: it keeps waits, comes back, and believes nothing wrong.
#include <doctest/doctest.h>

#include <string.h>

#include <initializer_list>

#include "bno055_registers.h"
#include "imu_profile.h"
#include "imu_rig.h"

namespace bunraku {
namespace {

constexpr ImuSettings kNdof{Fusion::kNdof, 0x24, 0x00};

struct Offsets {
  uint8_t bytes[22] = {7, 0, 0xF3, 0xFF, 0xF2, 0xFF, 9, 0, 4, 0, 200, 0, 3, 0, 2, 0, 1, 0, 0xE8, 3, 0xF4, 1};
  void set(size_t at, int value) {
    bytes[at] = static_cast<uint8_t>(value);
    bytes[at + 1] = static_cast<uint8_t>(value >> 8);
  }
};

}  // namespace

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
    Bno055 anew(rig.model);
    const Offsets profile;
    anew.start(ImuRig::kPlain, rig.clock.micros());
    const uint64_t begun_us = rig.clock.now_us();
    while (!anew.is_running() && rig.clock.now_us() < begun_us + 1000000) {
      anew.step(rig.clock.micros());
      if (anew.has_id()) anew.use_profile(profile.bytes, rig.clock.micros());  // it is kept by this id
      rig.clock.advance(700);
    }
    CHECK(anew.is_running());
    CHECK(rig.clock.now_us() - begun_us < 60000);
    for (int i = 0; i < 100; ++i) anew.step(rig.clock.micros());
    CHECK(anew.has_id());
    CHECK(anew.has_profile());
    CHECK(anew.recoveries() == 0);
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

TEST_CASE("no chip: it says so, and takes one that comes later") {
  ImuRig rig;
  rig.model.power_off();
  rig.power_on();
  rig.run(1.0);
  CHECK_FALSE(rig.imu.has_failed());
  rig.run(2);
  CHECK(rig.imu.has_failed());
  CHECK_FALSE(rig.imu.is_running());
  CHECK(rig.readings == 0);
  rig.model.power_on();
  CHECK(rig.run_until_reading() < 1.5);
  CHECK_FALSE(rig.imu.has_failed());
  CHECK(rig.imu.recoveries() == 0);
}

TEST_CASE("short trouble on the bus costs readings, not the heading") {
  for (const ImuFault fault : {ImuFault::kNack, ImuFault::kStuckBus, ImuFault::kZeroRead, ImuFault::kTornRead,
                               ImuFault::kFlippedBit}) {
    for (const uint32_t times : {1u, 2u, 5u}) {
      CAPTURE(static_cast<int>(fault));
      CAPTURE(times);
      ImuRig rig(times);
      rig.model.set_motion(dance);
      rig.power_on();
      rig.run(3);
      rig.longest_gap_us = 0;
      rig.model.inject(fault, times);
      rig.run(3);
      CHECK(rig.longest_gap_us < 200000);
      CHECK(rig.imu.is_running());
      CHECK(rig.imu.recoveries() == 0);
      CHECK(rig.model.counts().fusion_starts == 1);
      CHECK(rig.model.counts().injected[static_cast<size_t>(fault)] == times);
      rig.check_manners();
    }
  }
}

TEST_CASE("refused readings are counted by reason") {
  ImuRig rig(4);
  rig.model.set_orientation(turned(5, 1, 0, 0));
  rig.power_on();
  rig.run(2);
  rig.model.inject(ImuFault::kZeroRead);
  rig.run(0.2);
  CHECK(rig.imu.counts().zero == 1);
  rig.model.inject(ImuFault::kFlippedBit, 40);
  rig.run(2);
  CHECK(rig.imu.counts().torn > 2);
  CHECK(rig.imu.counts().norm > 2);
  rig.model.inject(ImuFault::kStuckBus);
  rig.run(0.2);
  CHECK(rig.imu.counts().bus_recoveries >= 1);
  rig.check_manners();
}

TEST_CASE("a chip that lost fusion is brought back, and the lost heading is said") {
  struct Trouble {
    ImuFault fault;
    double back_s;
    uint16_t ImuCounts::*reason;
  };
  for (const Trouble& trouble : {Trouble{ImuFault::kBrownOut, 0.7, &ImuCounts::brown_outs},
                                 Trouble{ImuFault::kSilentConfig, 0.2, &ImuCounts::silent_configs},
                                 Trouble{ImuFault::kFusionError, 2.2, &ImuCounts::fusion_errors},
                                 Trouble{ImuFault::kFrozen, 11, &ImuCounts::frozen}}) {
    for (const ImuSettings& settings : {ImuRig::kPlain, kNdof}) {
      CAPTURE(static_cast<int>(trouble.fault));
      ImuRig rig(9);
      rig.model.set_motion(dance);
      rig.power_on(settings);
      const Offsets profile;
      rig.imu.use_profile(profile.bytes, rig.clock.micros());
      rig.run(3);
      rig.model.inject(trouble.fault);
      const uint64_t begun_us = rig.clock.now_us();
      while (rig.imu.recoveries() == 0 && rig.clock.now_us() < begun_us + 20000000) rig.turn(700);
      rig.run_until_reading();
      CHECK(static_cast<double>(rig.clock.now_us() - begun_us) * 1e-6 < trouble.back_s);
      CHECK(rig.imu.recoveries() == 1);
      CHECK(rig.imu.counts().*trouble.reason == 1);
      CHECK(rig.imu.has_profile());
      CHECK(rig.model.peek(bno055::kUnits) == bno055::kMetric);
      rig.run(2);
      CHECK(rig.imu.recoveries() == 1);
      rig.check_manners();
    }
  }
}

TEST_CASE("after a lost heading the first readings are believed, however far they are from the last") {
  ImuRig rig;
  rig.model.set_motion([](uint64_t at_us) { return turned(static_cast<double>(at_us) * 40e-6, 0, 0, 1); });
  rig.power_on();
  rig.run(4);
  rig.model.inject(ImuFault::kSilentConfig);
  rig.run(1);
  CHECK(rig.imu.recoveries() == 1);
  CHECK(rig.imu.counts().rate == 0);
  CHECK(rig.imu.counts().relocated == 0);
}

TEST_CASE("wrong answers to a look at the chip's health do not cost the heading") {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    ImuRig rig(seed);
    rig.model.set_motion(dance);
    rig.power_on();
    rig.run(2);
    rig.model.set_probability(ImuFault::kZeroRead, 0.05);
    rig.run(30);
    CHECK(rig.imu.recoveries() == 0);
    CHECK(rig.imu.counts().zero > 10);
    rig.check_manners();
  }
}

TEST_CASE("the unique id and a saved profile are right even where every fifth answer is wrong") {
  for (uint64_t seed = 1; seed <= 40; ++seed) {
    CAPTURE(seed);
    uint8_t clean[22], saved[22];
    bool is_saved[2];
    for (const bool is_disturbed : {false, true}) {
      ImuRig rig(seed);
      rig.model.set_motion(dance);
      const double share = is_disturbed ? 0.1 : 0;
      rig.model.set_probability(ImuFault::kFlippedBit, share);
      rig.model.set_probability(ImuFault::kZeroRead, share);
      rig.power_on();
      rig.run(8);
      if (rig.imu.has_id()) CHECK(memcmp(rig.imu.unique_id(), rig.model.unique_id().data(), 16) == 0);
      rig.imu.save_profile(rig.clock.micros());
      rig.run(1);
      is_saved[is_disturbed] = rig.imu.profile_ready(is_disturbed ? saved : clean);
    }
    CHECK(is_saved[0]);
    if (is_saved[1]) CHECK(memcmp(saved, clean, 22) == 0);
  }
}

TEST_CASE("a wearable lying still for minutes is not taken for a frozen one") {
  ImuRig rig;
  rig.power_on();
  rig.run(180, 2000);
  CHECK(rig.imu.counts().frozen == 0);
  CHECK(rig.imu.recoveries() == 0);
}

TEST_CASE("settings that the chip forgets by itself are noticed within the second") {
  ImuRig rig;
  rig.model.set_motion(dance);
  rig.power_on({Fusion::kImuPlus, 0x21, 0x04});
  rig.run(3);
  rig.model.poke(bno055::kAxisMap, 0x24);
  rig.model.poke(bno055::kAxisSign, 0x00);
  rig.run(1.5);
  CHECK(rig.imu.recoveries() == 1);
  CHECK(rig.model.peek(bno055::kAxisMap) == 0x21);
}

TEST_CASE("a chip that never gets well is reset, later and later, and taken when it is well") {
  ImuRig rig;
  rig.power_on();
  rig.run(2);
  rig.model.set_probability(ImuFault::kFusionError, 0.2);
  rig.run(60);
  CHECK(rig.imu.has_failed());
  CHECK(rig.model.counts().resets >= 8);
  CHECK(rig.model.counts().resets <= 30);
  CHECK(rig.model.counts().early_accesses == 0);
  rig.model.set_probability(ImuFault::kFusionError, 0);
  CHECK(rig.run_until_reading() < 6);
  CHECK_FALSE(rig.imu.has_failed());
}

TEST_CASE("trouble long ago does not slow the next repair down") {
  ImuRig rig;
  rig.model.set_motion(dance);
  rig.power_on();
  rig.run(12);
  for (uint8_t times = 1; times <= 6; ++times) {
    rig.model.inject(ImuFault::kFusionError);
    rig.run(2.2);
    CHECK(rig.imu.is_running());
    CHECK(rig.imu.recoveries() == times);
    rig.run(12);
  }
  CHECK(rig.model.counts().resets == 6);
  rig.check_manners();
}

TEST_CASE("a chip that says all is well and gives zeros is started anew") {
  ImuRig rig;
  rig.model.set_motion(dance);
  rig.power_on();
  rig.run(2);
  rig.model.inject(ImuFault::kZeroRead, 40);
  rig.run(3);
  CHECK(rig.imu.counts().frozen == 1);
  CHECK(rig.imu.recoveries() == 1);
  CHECK(rig.imu.is_running());
  rig.check_manners();
}

TEST_CASE("a profile that fusion refuses is dropped: rather without than not at all") {
  ImuRig rig;
  const Offsets profile;
  rig.power_on();
  rig.imu.use_profile(profile.bytes, rig.clock.micros());
  rig.run(2);
  CHECK(rig.imu.has_profile());
  rig.model.poke(bno055::kSystemError, bno055::kErrorConfiguration);
  rig.run(4);
  CHECK(rig.imu.is_running());
  CHECK_FALSE(rig.imu.has_profile());
  CHECK(rig.imu.counts().refused_profiles == 1);
  CHECK(rig.model.counts().resets == 1);
}

TEST_CASE("profiles: restored at once before start, through CONFIG mode later, and after a brown-out") {
  ImuRig rig;
  Offsets profile;
  rig.model.set_motion(dance);
  rig.power_on();
  SUBCASE("before fusion starts") {
    rig.imu.use_profile(profile.bytes, rig.clock.micros());
    rig.run(2);
    CHECK(rig.imu.recoveries() == 0);
    CHECK(rig.model.counts().fusion_starts == 1);
  }
  SUBCASE("while it runs: the heading is lost, once; the same again changes nothing") {
    rig.run(2);
    CHECK_FALSE(rig.imu.has_profile());
    for (int i = 0; i < 5; ++i) {
      rig.imu.use_profile(profile.bytes, rig.clock.micros());
      rig.run(1);
    }
    CHECK(rig.imu.recoveries() == 1);
    CHECK(rig.model.counts().fusion_starts == 2);
  }
  CHECK(rig.imu.has_profile());
  CHECK(rig.model.peek(bno055::kCalibration) == 0x3C);
  rig.model.inject(ImuFault::kBrownOut);
  rig.run(2);
  CHECK(rig.imu.is_running());
  CHECK(rig.imu.has_profile());
  CHECK(rig.model.peek(bno055::kCalibration) == 0x3C);
  rig.check_manners();
}

TEST_CASE("radii that the chip would choke on are left out; nonsense is refused whole") {
  Offsets profile;
  CHECK(sound_profile_bytes(profile.bytes) == 22);
  for (const int radius : {0, 143, 1281, -1}) {
    profile.set(20, radius);
    CHECK(sound_profile_bytes(profile.bytes) == 20);
    ImuRig rig;
    rig.power_on();
    rig.imu.use_profile(profile.bytes, rig.clock.micros());
    CHECK(rig.run_until_reading() < 0.6);
    CHECK(rig.imu.has_profile());
    CHECK(rig.imu.counts().fusion_errors == 0);
    rig.check_manners();
  }
  profile.set(18, 0);
  CHECK(sound_profile_bytes(profile.bytes) == 18);
  for (const size_t at : {0u, 6u}) {
    Offsets wild;
    wild.set(at, 20000);
    CHECK(sound_profile_bytes(wild.bytes) == 0);
  }
  for (const uint8_t fill : {uint8_t{0x00}, uint8_t{0xFF}}) {
    ImuRig rig;
    uint8_t blank[22];
    memset(blank, fill, sizeof blank);
    rig.power_on();
    rig.imu.use_profile(blank, rig.clock.micros());
    rig.run(1);
    CHECK(rig.imu.counts().refused_profiles == 1);
    CHECK_FALSE(rig.imu.has_profile());
    CHECK(rig.imu.is_running());
  }
}

TEST_CASE("a saved profile can be restored into the same chip after a power cycle, in both fusions") {
  for (const ImuSettings& settings : {ImuRig::kPlain, kNdof}) {
    ImuRig rig;
    rig.model.set_motion(dance);
    rig.power_on(settings);
    uint8_t saved[22];
    rig.run(8);
    REQUIRE(rig.imu.is_calibrated());
    CHECK_FALSE(rig.imu.profile_ready(saved));
    rig.imu.save_profile(rig.clock.micros());
    rig.run(1);
    REQUIRE(rig.imu.profile_ready(saved));
    CHECK_FALSE(rig.imu.profile_ready(saved));
    CHECK(rig.imu.has_profile());
    CHECK(rig.imu.recoveries() == 1);
    CHECK(rig.imu.is_running());
    CHECK(sound_profile_bytes(saved) == (settings.fusion == Fusion::kNdof ? 22 : 20));

    rig.model.power_on();
    Bno055 anew(rig.model);
    anew.start(settings, rig.clock.micros());
    anew.use_profile(saved, rig.clock.micros());
    for (int i = 0; i < 4000; ++i) {
      anew.step(rig.clock.micros());
      rig.clock.advance(700);
    }
    CHECK(anew.is_running());
    CHECK(anew.is_calibrated());
    CHECK(anew.counts().fusion_errors == 0);
    rig.check_manners();
  }
}

TEST_CASE("a profile is not saved from a chip that fails meanwhile") {
  ImuRig rig;
  rig.model.set_motion(dance);
  rig.power_on();
  rig.run(8);
  rig.imu.save_profile(rig.clock.micros());
  rig.model.inject(ImuFault::kBrownOut);
  rig.run(3);
  uint8_t saved[22];
  CHECK_FALSE(rig.imu.profile_ready(saved));
  CHECK(rig.imu.is_running());
}

TEST_CASE("a loop that stalls, or a bus that stretches much more, breaks no wait") {
  for (const uint32_t loop_us : {50u, 5000u, 60000u}) {
    ImuRig rig;
    rig.model.set_motion(dance);
    rig.power_on();
    rig.run(5, loop_us);
    const Offsets profile;
    rig.imu.use_profile(profile.bytes, rig.clock.micros());
    rig.run(2, loop_us);
    rig.imu.save_profile(rig.clock.micros());
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

TEST_CASE("whatever mix of faults: nothing wrong is believed, no wait is broken, and it comes back") {
  uint32_t believed = 0;
  for (uint64_t seed = 1; seed <= 60; ++seed) {
    CAPTURE(seed);
    Random random(seed);
    ImuRig rig(seed, 0xFFFFFFFFu - random.between(0, 30000000));
    rig.model.set_motion(dance);
    rig.model.drift_degrees_minute = 5;
    const double often = random.happens(0.5) ? 0.02 : 0.15;
    for (const ImuFault fault : {ImuFault::kNack, ImuFault::kStuckBus, ImuFault::kZeroRead,
                                 ImuFault::kTornRead, ImuFault::kFlippedBit}) {
      if (random.happens(0.6)) rig.model.set_probability(fault, random.share() * often);
    }
    for (const ImuFault fault : {ImuFault::kBrownOut, ImuFault::kSilentConfig, ImuFault::kFusionError}) {
      if (random.happens(0.4)) rig.model.set_probability(fault, random.share() * 0.002);
    }
    rig.power_on(random.happens(0.5) ? ImuRig::kPlain : kNdof);
    rig.run(20);
    believed += rig.readings;
    CHECK(rig.most_transactions <= 1);
    CHECK(rig.worst_degrees <= 0);
    CHECK(rig.model.counts().early_accesses == 0);
    for (size_t fault = 0; fault < kImuFaults; ++fault) rig.model.set_probability(ImuFault(fault), 0);
    CHECK(rig.run_until_reading() < 8);
    rig.run(10);
    CHECK(rig.imu.is_running());
    CHECK_FALSE(rig.imu.has_failed());
  }
  CHECK(believed > 60 * 400);
}

}  // namespace bunraku
