// The BNO085's driver on the simulated hub, in virtual time: start-up, pace, times, trouble, its calibration.
#include "bno085.h"

#include <doctest/doctest.h>

#include <cstring>
#include <initializer_list>

#include "bno055.h"
#include "bno055_model.h"
#include "bno085_model.h"
#include "report_rig.h"
#include "sh2.h"

namespace bunraku {
namespace {

using HubRig = ReportRig<Bno085, Bno085Model>;

}  // namespace

TEST_CASE("BNO085: from power-on to the first reading, whatever its seed and the clock's wrap") {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    HubRig rig(seed, seed % 2 == 0 ? 0xFFFFFFFFu - 20000 * seed : 1000);
    rig.model.set_motion(dance);
    rig.power_on();
    CHECK(rig.run_until_reading() < 0.4);
    CHECK(rig.imu.has_id());
    CHECK(memcmp(rig.imu.unique_id(), "BNO8", 4) == 0);
    CHECK(rig.imu.recoveries() == 0);
    CHECK(rig.model.counts().resets == 0);
    rig.run(1);
    rig.check_manners();
  }
  HubRig one(1), other(2);
  for (HubRig* rig : {&one, &other}) rig->power_on(), rig->run(1);
  CHECK(memcmp(one.imu.unique_id(), other.imu.unique_id(), kImuIdBytes) != 0);
}

TEST_CASE("BNO085: 50 and 100 readings a second, young, and 100 accelerations") {
  for (const uint32_t period_us : {20000u, 10000u}) {
    for (const ImuSettings& settings : {HubRig::kPlain, HubRig::kNdof}) {
      HubRig rig;
      rig.model.set_motion(dance);
      rig.power_on(settings, period_us);
      rig.run(1);
      const uint32_t readings = rig.readings, accelerations = rig.accelerations;
      const uint16_t bus_errors = rig.imu.counts().bus_errors;  // before the hub was up
      rig.oldest_us = 0;
      rig.longest_gap_us = 0;
      rig.run(20);
      CHECK(rig.readings - readings >= 20000000 / period_us - 1);
      CHECK(rig.longest_gap_us < period_us + 3000);
      CHECK(rig.oldest_us < 8000);
      CHECK(rig.accelerations - accelerations >= 1990);
      CHECK(rig.imu.is_calibrated());
      CHECK((rig.sample.calibration & 0x3C) == 0x3C);
      CHECK(rig.imu.counts().bus_errors == bus_errors);
      rig.check_manners();
    }
  }
}

TEST_CASE("BNO085: a hub that does not acknowledge a read while it has nothing to say is driven too") {
  HubRig rig(3);
  rig.model.is_shy = true;
  rig.model.set_motion(dance);
  rig.power_on();
  CHECK(rig.run_until_reading() < 0.4);
  const uint32_t readings = rig.readings;
  rig.run(20);
  CHECK(rig.readings - readings >= 999);
  CHECK(rig.imu.recoveries() == 0);
  CHECK(rig.imu.counts().silences == 0);
  rig.check_manners();
}

TEST_CASE("BNO085: a knock reaches the taps") {
  HubRig rig;
  rig.power_on();
  rig.run(2);
  CHECK(rig.hardest < 10);
  rig.model.tap(rig.clock.now_us() + 3000, 30);
  rig.run(0.1);
  CHECK(rig.hardest > 2000);
}

TEST_CASE("BNO085: the board restarts, the hub does not: its heading is kept; other settings are another fusion") {
  HubRig rig;
  rig.model.set_motion(dance);
  rig.power_on();
  rig.run(3);
  Bno085 restarted(rig.model);
  restarted.start(HubRig::kPlain, rig.clock.micros());
  const uint64_t begun_us = rig.clock.now_us();
  while (!restarted.is_running() && rig.clock.now_us() < begun_us + 1000000) {
    restarted.step(rig.clock.micros());
    rig.clock.advance(300);
  }
  CHECK(rig.clock.now_us() - begun_us < 100000);
  CHECK(restarted.recoveries() == 0);
  restarted.start(HubRig::kNdof, rig.clock.micros());
  for (int i = 0; i < 1000; ++i) restarted.step(rig.clock.micros()), rig.clock.advance(300);
  CHECK(restarted.is_running());
  CHECK(restarted.recoveries() == 1);
  CHECK(rig.model.interval_us(sh2::kRotationVector) > 0);
  CHECK(rig.model.interval_us(sh2::kGameRotationVector) == 0);
  CHECK(rig.model.counts().fusion_starts == 1);
}

TEST_CASE("BNO085: axes are turned as the BNO055 turns its own") {
  for (int map = 0; map < 0x40; ++map) {
    for (int sign = 0; sign < 8; ++sign) {
      const uint8_t axis_map = static_cast<uint8_t>(map), axis_sign = static_cast<uint8_t>(sign);
      if (!is_axis_remap(axis_map, axis_sign)) continue;
      VirtualClock clock(1000000);
      Bno055Model other(clock, 1);
      Bno085Model model(clock, 1);
      Bno055 reference(other);
      Bno085 imu(model);
      for (ImuModel* each : {static_cast<ImuModel*>(&other), static_cast<ImuModel*>(&model)})
        each->set_orientation(turned(70, 1, 2, 3));
      reference.start({Fusion::kNdof, axis_map, axis_sign}, clock.micros());
      imu.start({Fusion::kNdof, axis_map, axis_sign}, clock.micros());
      Sample by_reference = {}, by_imu = {};
      for (int i = 0; i < 3000; ++i) {
        reference.step(clock.micros());
        imu.step(clock.micros());
        clock.advance(300);
        if (i % 60 == 0) reference.sample(clock.micros(), by_reference), imu.sample(clock.micros(), by_imu);
      }
      CHECK(degrees_between(quaternion(by_reference.orientation), quaternion(by_imu.orientation)) < 0.1);
    }
  }
}

TEST_CASE("BNO085: no hub: it says so, and takes one that comes later, at either address") {
  for (const uint8_t address : {sh2::kAddress, sh2::kOtherAddress}) {
    VirtualClock clock(5);
    Bno085Model model(clock, 3, address);
    Bno085 imu(model);
    model.power_off();
    imu.start(HubRig::kPlain, clock.micros());
    const auto run_until = [&](auto is_so) {
      const uint64_t begun_us = clock.now_us();
      while (!is_so() && clock.now_us() < begun_us + 5000000) imu.step(clock.micros()), clock.advance(300);
      return is_so();
    };
    CHECK(run_until([&] { return imu.has_failed(); }));
    model.power_on();
    CHECK(run_until([&] { return imu.is_running(); }));
    CHECK_FALSE(imu.has_failed());
  }
}

TEST_CASE("BNO085: short trouble on the bus costs readings, not the heading") {
  for (const ImuFault fault :
       {ImuFault::kNack, ImuFault::kStuckBus, ImuFault::kZeroRead, ImuFault::kTornRead, ImuFault::kFlippedBit}) {
    for (const uint32_t times : {1u, 2u, 5u}) {
      CAPTURE(static_cast<int>(fault));
      CAPTURE(times);
      HubRig rig(times);
      rig.model.set_motion(dance);
      rig.power_on();
      rig.run(3);
      rig.longest_gap_us = 0;
      rig.model.inject(fault, times);
      rig.run(3);
      CHECK(rig.longest_gap_us < 200000);
      CHECK(rig.imu.is_running());
      CHECK(rig.imu.recoveries() == 0);
      CHECK(rig.model.counts().injected[static_cast<size_t>(fault)] == times);
      rig.check_manners(3);
    }
  }
}

TEST_CASE("BNO085: a hub that lost its fusion is brought back, and the lost heading is said") {
  struct Trouble {
    ImuFault fault;
    double back_s;
    uint16_t Bno085Counts::* reason;
  };
  for (const Trouble& trouble : {Trouble{ImuFault::kBrownOut, 0.5, &Bno085Counts::restarts},
                                 Trouble{ImuFault::kSilentConfig, 0.6, &Bno085Counts::silences},
                                 Trouble{ImuFault::kFusionError, 4.0, &Bno085Counts::resets},
                                 Trouble{ImuFault::kFrozen, 4.0, &Bno085Counts::resets}}) {
    for (const ImuSettings& settings : {HubRig::kPlain, HubRig::kNdof}) {
      CAPTURE(static_cast<int>(trouble.fault));
      HubRig rig(9);
      rig.model.set_motion(dance);
      rig.power_on(settings);
      rig.run(3);
      rig.model.inject(trouble.fault);
      const uint64_t begun_us = rig.clock.now_us();
      while (rig.imu.recoveries() == 0 && rig.clock.now_us() < begun_us + 20000000) rig.turn(300);
      rig.run_until_reading();
      CHECK(static_cast<double>(rig.clock.now_us() - begun_us) * 1e-6 < trouble.back_s);
      CHECK(rig.imu.recoveries() == 1);
      CHECK(rig.imu.counts().*trouble.reason == 1);
      rig.run(2);
      CHECK(rig.imu.recoveries() == 1);
      rig.check_manners();
    }
  }
}

TEST_CASE("BNO085: with trouble in one transaction of twenty it dances on, and believes nothing wrong") {
  for (const ImuFault fault :
       {ImuFault::kNack, ImuFault::kStuckBus, ImuFault::kZeroRead, ImuFault::kTornRead, ImuFault::kFlippedBit}) {
    CAPTURE(static_cast<int>(fault));
    HubRig rig(12);
    rig.model.set_motion(dance);
    rig.power_on();
    rig.run(2);
    rig.model.set_probability(fault, 0.05);
    const uint32_t readings = rig.readings;
    rig.run(60);
    CHECK(rig.readings - readings > 2500);
    rig.check_manners(5);
  }
}

TEST_CASE("BNO085: a loop that stalls gets the newest orientation, and takes no stall for silence") {
  for (const uint32_t loop_us : {50u, 4000u, 60000u}) {
    HubRig rig;
    rig.model.set_motion(dance);
    rig.power_on();
    rig.run(10, loop_us);
    CHECK(rig.imu.is_running());
    CHECK(rig.imu.recoveries() == 0);
    CHECK(rig.imu.counts().silences == 0);
  }
  HubRig rig;
  rig.power_on();
  rig.run(2);
  rig.clock.advance(10000000);  // a join
  rig.run(2);
  CHECK(rig.imu.recoveries() == 0);
  CHECK(rig.imu.counts().silences == 0);
  rig.check_manners();
}

TEST_CASE("BNO085: it saves its calibration in its own flash, and the next power-on finds it there") {
  HubRig rig(4);
  rig.model.set_motion(dance);
  rig.power_on();
  rig.run(5);
  CHECK_FALSE(rig.imu.has_profile());
  rig.model.refuses_saves = true;
  rig.imu.save_profile();
  rig.run(1);
  CHECK(rig.imu.counts().refused_saves == 1);
  CHECK_FALSE(rig.imu.has_profile());
  rig.model.refuses_saves = false;
  rig.imu.save_profile();
  rig.run(1);
  CHECK(rig.model.saves() == 1);
  CHECK(rig.imu.has_profile());
  CHECK(rig.imu.recoveries() == 0);
  uint8_t bytes[kProfileBytes] = {};
  CHECK_FALSE(rig.imu.profile_ready(bytes));
  CHECK_FALSE(rig.imu.use_profile(bytes));
  Bno085 restarted(rig.model);
  rig.model.power_on();
  restarted.start(HubRig::kPlain, rig.clock.micros());
  for (int i = 0; i < 10000; ++i) restarted.step(rig.clock.micros()), rig.clock.advance(300);
  CHECK(restarted.has_profile());
  CHECK(restarted.is_calibrated());
  rig.check_manners();
}

}  // namespace bunraku
