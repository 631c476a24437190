// Trouble with the simulated chip: the driver comes back, says a lost heading, and believes nothing wrong.
#include <doctest/doctest.h>

#include <initializer_list>

#include "bno055_registers.h"
#include "imu_rig.h"

namespace bunraku {

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
  for (const ImuFault fault :
       {ImuFault::kNack, ImuFault::kStuckBus, ImuFault::kZeroRead, ImuFault::kTornRead, ImuFault::kFlippedBit}) {
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
    uint16_t ImuCounts::* reason;
  };
  for (const Trouble& trouble : {Trouble{ImuFault::kBrownOut, 0.7, &ImuCounts::brown_outs},
                                 Trouble{ImuFault::kSilentConfig, 0.2, &ImuCounts::silent_configs},
                                 Trouble{ImuFault::kFusionError, 2.2, &ImuCounts::fusion_errors},
                                 Trouble{ImuFault::kFrozen, 11, &ImuCounts::frozen}}) {
    for (const ImuSettings& settings : {ImuRig::kPlain, ImuRig::kNdof}) {
      CAPTURE(static_cast<int>(trouble.fault));
      ImuRig rig(9);
      rig.model.set_motion(dance);
      rig.power_on(settings);
      const Offsets profile;
      rig.imu.use_profile(profile.bytes);
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

TEST_CASE("fusion that stopped with an error gives at most 100 ms of readings that stand still") {
  ImuRig rig(3);
  rig.model.set_motion(dance);
  rig.power_on();
  rig.run(3.2);
  rig.model.inject(ImuFault::kFusionError);
  const uint32_t before = rig.readings;
  rig.run(0.5);
  CHECK(rig.readings - before <= 5);
  CHECK(rig.imu.counts().fusion_errors == 1);
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

TEST_CASE("a chip that reports success but reads zeros is restarted") {
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

TEST_CASE("whatever mix of faults: nothing wrong is believed, no wait is broken, and it comes back") {
  uint32_t believed = 0;
  for (uint64_t seed = 1; seed <= 60; ++seed) {
    CAPTURE(seed);
    Random random(seed);
    ImuRig rig(seed, 0xFFFFFFFFu - random.between(0, 30000000));
    rig.model.set_motion(dance);
    rig.model.drift_degrees_minute = 5;
    const double often = random.happens(0.5) ? 0.02 : 0.15;
    for (const ImuFault fault :
         {ImuFault::kNack, ImuFault::kStuckBus, ImuFault::kZeroRead, ImuFault::kTornRead, ImuFault::kFlippedBit}) {
      if (random.happens(0.6)) rig.model.set_probability(fault, random.share() * often);
    }
    for (const ImuFault fault : {ImuFault::kBrownOut, ImuFault::kSilentConfig, ImuFault::kFusionError}) {
      if (random.happens(0.4)) rig.model.set_probability(fault, random.share() * 0.002);
    }
    rig.power_on(random.happens(0.5) ? ImuRig::kPlain : ImuRig::kNdof);
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
