// The LSM6DSV's driver and VQF on the simulated chip, in virtual time: start-up, pace, drift, trouble.
#include "lsm6dsv.h"

#include <doctest/doctest.h>

#include <initializer_list>

#include "lsm6dsv_model.h"
#include "lsm6dsv_registers.h"
#include "report_rig.h"

namespace bunraku {
namespace {

// Stands still for five seconds, as for a neutral pose, and dances then.
struct LsmRig : ReportRig<Lsm6dsv, Lsm6dsvModel> {
  explicit LsmRig(uint64_t seed = 1, uint64_t start_us = 1000000) : ReportRig(seed, start_us) {
    is_heading_free = true;
    const uint64_t dances_us = start_us + 5000000;
    model.set_motion([dances_us](uint64_t at_us) { return dance(at_us < dances_us ? 0 : at_us - dances_us); });
  }
};

}  // namespace

TEST_CASE("LSM6DSV: from power-on to the first reading, and a minute's dance after standing still") {
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    LsmRig rig(seed, seed % 2 == 0 ? 0xFFFFFFFFu - 20000 * seed : 1000);
    rig.power_on();
    CHECK(rig.run_until_reading() < 0.2);
    CHECK(rig.imu.has_id());
    CHECK_FALSE(rig.imu.is_calibrated());
    rig.run(5);
    CHECK(rig.imu.is_calibrated());
    rig.run(60);
    CHECK(rig.imu.recoveries() == 0);
    rig.check_manners(3);
  }
}

TEST_CASE("LSM6DSV: 50 and 100 readings a second, young, and 120 accelerations") {
  for (const uint32_t period_us : {20000u, 10000u}) {
    LsmRig rig;
    rig.power_on(LsmRig::kPlain, period_us);
    rig.run(1);
    const uint32_t readings = rig.readings, accelerations = rig.accelerations;
    rig.oldest_us = 0;
    rig.longest_gap_us = 0;
    rig.run(20);
    CHECK(rig.readings - readings >= 20000000 / period_us - 1);
    CHECK(rig.longest_gap_us < period_us + 3000);
    CHECK(rig.oldest_us < 12000);
    CHECK(rig.accelerations - accelerations >= 2200);
    rig.check_manners(3);
  }
}

TEST_CASE("LSM6DSV: a knock reaches the taps") {
  LsmRig rig;
  rig.power_on();
  rig.run(2);
  CHECK(rig.hardest < 60);
  rig.model.tap(rig.clock.now_us() + 3000, 30);
  rig.run(0.1);
  CHECK(rig.hardest > 2000);
}

TEST_CASE("LSM6DSV: no chip: it says so, and takes one that comes later, at either address") {
  for (const uint8_t address : {lsm6dsv::kAddress, lsm6dsv::kOtherAddress}) {
    VirtualClock clock(5);
    Lsm6dsvModel model(clock, 3, address);
    Lsm6dsv imu(model);
    model.power_off();
    imu.start(LsmRig::kPlain, clock.micros());
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

TEST_CASE("LSM6DSV: short trouble on the bus costs a little accuracy, not the heading") {
  for (const ImuFault fault :
       {ImuFault::kNack, ImuFault::kStuckBus, ImuFault::kZeroRead, ImuFault::kTornRead, ImuFault::kFlippedBit}) {
    for (const uint32_t times : {1u, 2u, 5u}) {
      CAPTURE(static_cast<int>(fault));
      CAPTURE(times);
      LsmRig rig(times);
      rig.power_on();
      rig.run(8);
      rig.longest_gap_us = 0;
      rig.model.inject(fault, times);
      rig.run(5);
      CHECK(rig.longest_gap_us < 100000);
      CHECK(rig.imu.recoveries() == 0);
      CHECK(rig.model.counts().injected[static_cast<size_t>(fault)] == times);
      rig.check_manners(12);
    }
  }
}

TEST_CASE("LSM6DSV: a chip that stopped is brought back, and the lost heading is said") {
  for (const ImuFault fault :
       {ImuFault::kBrownOut, ImuFault::kSilentConfig, ImuFault::kFusionError, ImuFault::kFrozen}) {
    CAPTURE(static_cast<int>(fault));
    LsmRig rig(9);
    rig.power_on();
    rig.run(4);  // it stands: what a frozen chip hides of the dance would count as its error
    rig.model.inject(fault);
    const uint64_t begun_us = rig.clock.now_us();
    while (rig.imu.recoveries() == 0 && rig.clock.now_us() < begun_us + 20000000) rig.turn(300);
    rig.run_until_reading();
    CHECK(static_cast<double>(rig.clock.now_us() - begun_us) * 1e-6 < 2.0);
    CHECK(rig.imu.recoveries() == 1);
    const Lsm6dsvCounts& counts = rig.imu.counts();
    const bool is_found_booting = counts.bus_errors >= 8;  // it is searched for again
    CHECK(counts.silences + counts.brown_outs + counts.frozen + (is_found_booting ? 1 : 0) == 1);
    CHECK(rig.model.counts().illegal_writes == 0);
    CHECK(rig.model.counts().early_accesses == 0);
    rig.run(2);
    CHECK(rig.imu.recoveries() == 1);
  }
}

TEST_CASE("LSM6DSV: a loop that stalls loses nothing within a second, and says what it lost in ten") {
  LsmRig rig;
  rig.power_on();
  rig.run(8);
  rig.clock.advance(900000);
  rig.run(2);
  CHECK(rig.imu.recoveries() == 0);
  CHECK(rig.worst_degrees < 3);
  rig.clock.advance(10000000);
  rig.starts = 0;  // the chip went on, and yet the heading is lost
  rig.run(2);
  CHECK(rig.imu.recoveries() == 1);
  CHECK(rig.imu.counts().overruns == 1);
  CHECK(rig.imu.counts().silences == 0);
}

TEST_CASE("LSM6DSV: axes are turned, its level stays what it is") {
  LsmRig rig(2);
  rig.model.set_orientation(turned(90, 1, 0, 0));
  rig.power_on({Fusion::kImuPlus, 0x24, 0x00});
  rig.run(1);
  const Quaternion plain = quaternion(rig.sample.orientation);
  rig.imu.start({Fusion::kImuPlus, 0x21, 0x04}, rig.clock.micros());  // a quarter turn about z
  rig.run(0.5);
  const Quaternion other = quaternion(rig.sample.orientation);
  CHECK(degrees_between(plain, other) == doctest::Approx(90).epsilon(0.01));
  CHECK(rig.imu.recoveries() == 0);
}

}  // namespace bunraku
