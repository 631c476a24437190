// The search: whichever chip is wired is found and driven, and nobody else is disturbed by it.
#include "imu_search.h"

#include <doctest/doctest.h>

#include <memory>

#include "any_imu.h"
#include "bno055_model.h"
#include "bno085_model.h"
#include "dancing_arm.h"
#include "lsm6dsv_model.h"

namespace bunraku {
namespace {

struct Found {
  VirtualClock clock{1000000};
  std::unique_ptr<ImuModel> model;
  std::unique_ptr<AnyImu> any;

  template <typename Model>
  void wire() {
    model = std::make_unique<Model>(clock, 4);
    any = std::make_unique<AnyImu>(*model);
    model->set_motion(dance);
  }
  Imu& imu() { return *any; }

  // Seconds until it runs, or the limit; never more than a transaction a step.
  double run_until_running(double limit_s) {
    const uint64_t begun_us = clock.now_us();
    while (!imu().is_running() && clock.now_us() < begun_us + static_cast<uint64_t>(limit_s * 1e6)) {
      const uint32_t before = model->counts().transactions + model->counts().recovers;
      imu().step(clock.micros());
      CHECK(model->counts().transactions + model->counts().recovers - before <= 1);
      clock.advance(300);
    }
    return static_cast<double>(clock.now_us() - begun_us) * 1e-6;
  }
};

}  // namespace

TEST_CASE("whatever chip is wired, it runs within a second of power-on, and gives readings") {
  Found wired[3];
  wired[0].wire<Bno055Model>();
  wired[1].wire<Bno085Model>();
  wired[2].wire<Lsm6dsvModel>();
  for (Found& found : wired) {
    found.imu().start({Fusion::kImuPlus, 0x24, 0x00}, found.clock.micros());
    CHECK_FALSE(found.imu().has_id());
    CHECK(found.run_until_running(3) < 1);
    REQUIRE(found.imu().has_id());
    int readings = 0;
    for (int turn = 0; turn < 3000; ++turn) {
      found.imu().step(found.clock.micros());
      Sample sample;
      if (turn % 60 == 0) readings += found.imu().sample(found.clock.micros(), sample) ? 1 : 0;
      found.clock.advance(300);
    }
    CHECK(readings >= 48);
    CHECK_FALSE(found.imu().has_failed());
    CHECK(found.imu().recoveries() == 0);
    CHECK(found.model->counts().illegal_writes == 0);
    CHECK(found.model->counts().early_accesses == 0);
  }
}

TEST_CASE("without a chip the search has failed after two seconds, and goes on") {
  Found found;
  found.wire<Bno085Model>();
  found.model->power_off();
  found.imu().start({Fusion::kImuPlus, 0x24, 0x00}, found.clock.micros());
  found.run_until_running(2);
  CHECK(found.imu().has_failed());
  uint8_t profile[kProfileBytes] = {};
  found.imu().save_profile();
  CHECK_FALSE(found.imu().use_profile(profile));
  CHECK_FALSE(found.imu().profile_ready(profile));
  found.model->power_on();
  CHECK(found.run_until_running(5) < 2);
  CHECK_FALSE(found.imu().has_failed());
}

}  // namespace bunraku
