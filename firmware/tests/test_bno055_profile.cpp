// Calibration profiles on the simulated chip: saved, restored, doubted.
#include <doctest/doctest.h>

#include <string.h>

#include <initializer_list>

#include "bno055_registers.h"
#include "imu_profile.h"
#include "imu_rig.h"

namespace bunraku {

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
      rig.imu.save_profile();
      rig.run(1);
      is_saved[is_disturbed] = rig.imu.profile_ready(is_disturbed ? saved : clean);
    }
    CHECK(is_saved[0]);
    if (is_saved[1]) CHECK(memcmp(saved, clean, 22) == 0);
  }
}

TEST_CASE("a profile that fusion refuses is dropped: rather without than not at all") {
  ImuRig rig;
  const Offsets profile;
  rig.power_on();
  rig.imu.use_profile(profile.bytes);
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
    rig.imu.use_profile(profile.bytes);
    rig.run(2);
    CHECK(rig.imu.recoveries() == 0);
    CHECK(rig.model.counts().fusion_starts == 1);
  }
  SUBCASE("while it runs: the heading is lost, once; the same again changes nothing") {
    rig.run(2);
    CHECK_FALSE(rig.imu.has_profile());
    for (int i = 0; i < 5; ++i) {
      rig.imu.use_profile(profile.bytes);
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
    rig.imu.use_profile(profile.bytes);
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
    rig.imu.use_profile(blank);
    rig.run(1);
    CHECK(rig.imu.counts().refused_profiles == 1);
    CHECK_FALSE(rig.imu.has_profile());
    CHECK(rig.imu.is_running());
  }
}

TEST_CASE("a saved profile can be restored into the same chip after a power cycle, in both fusions") {
  for (const ImuSettings& settings : {ImuRig::kPlain, ImuRig::kNdof}) {
    ImuRig rig;
    rig.model.set_motion(dance);
    rig.power_on(settings);
    uint8_t saved[22];
    rig.run(8);
    REQUIRE(rig.imu.is_calibrated());
    CHECK_FALSE(rig.imu.profile_ready(saved));
    rig.imu.save_profile();
    rig.run(1);
    REQUIRE(rig.imu.profile_ready(saved));
    CHECK_FALSE(rig.imu.profile_ready(saved));
    CHECK(rig.imu.has_profile());
    CHECK(rig.imu.recoveries() == 1);
    CHECK(rig.imu.is_running());
    CHECK(sound_profile_bytes(saved) == (settings.fusion == Fusion::kNdof ? 22 : 20));

    rig.model.power_on();
    Bno055 restarted(rig.model);
    restarted.start(settings, rig.clock.micros());
    restarted.use_profile(saved);
    for (int i = 0; i < 4000; ++i) {
      restarted.step(rig.clock.micros());
      rig.clock.advance(700);
    }
    CHECK(restarted.is_running());
    CHECK(restarted.is_calibrated());
    CHECK(restarted.counts().fusion_errors == 0);
    rig.check_manners();
  }
}

TEST_CASE("a profile is not saved from a chip that fails meanwhile") {
  ImuRig rig;
  rig.model.set_motion(dance);
  rig.power_on();
  rig.run(8);
  rig.imu.save_profile();
  rig.model.inject(ImuFault::kBrownOut);
  rig.run(3);
  uint8_t saved[22];
  CHECK_FALSE(rig.imu.profile_ready(saved));
  CHECK(rig.imu.is_running());
}

}  // namespace bunraku
