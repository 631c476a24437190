// Calibrations between wearable and box: told once linked, taken from the box only when they are wanted.
#include <doctest/doctest.h>

#include <cstring>

#include "wearer.h"

using namespace bunraku;
using fakes::BoxSide;
using fakes::Bytes;
using fakes::signed_packet;

TEST_CASE("a saved calibration is told three times, a second apart, once linked") {
  Wearer wearer;
  uint8_t offsets[22] = {1, 2, 3};
  wearer.pairing.announce_profile(offsets);
  wearer.pairing.set_lane(Lane::kWifi, true);
  wearer.wait(2 * kSecond);
  CHECK(wearer.of(wire::Profile::kKind, Lane::kWifi).empty());
  wearer.link();
  wearer.dance(6);
  const auto profiles = wearer.of(wire::Profile::kKind, Lane::kWifi);
  REQUIRE(profiles.size() == 3);
  CHECK(profiles[1].at_us - profiles[0].at_us == kSecond);
  for (uint32_t i = 0; i < 3; ++i) {
    const auto profile = profiles[i].as<wire::Profile>();
    CHECK(profile.sequence == i + 1);
    CHECK(profile.session == wearer.box.session);
    CHECK(memcmp(profile.offsets, offsets, 22) == 0);
    CHECK(memcmp(profile.imu_id, wearer.condition.imu_id, 16) == 0);
    CHECK(fakes::is_signed(profiles[i].data));
  }
}

TEST_CASE("a calibration kept by the box is taken within 10 s of the assignment, once, by its own IMU") {
  Wearer wearer;
  wearer.link();
  uint8_t other_imu[16] = {9};
  CHECK(wearer.hear(wearer.box.restore(other_imu)) == Received::kNothing);
  const Bytes restore = signed_packet(wearer.box.restore(wearer.condition.imu_id));
  CHECK(wearer.hear(restore) == Received::kRestore);
  CHECK(wearer.hear(restore) == Received::kNothing);
  BoxSide old = wearer.box;
  old.session ^= 1;
  CHECK(wearer.hear(old.restore(wearer.condition.imu_id)) == Received::kNothing);
  wearer.dance(9);
  CHECK(wearer.hear(wearer.box.restore(wearer.condition.imu_id)) == Received::kRestore);
  wearer.dance(1);
  CHECK(wearer.hear(wearer.box.restore(wearer.condition.imu_id)) == Received::kNothing);
}

TEST_CASE("a wearable that has a calibration keeps it") {
  Wearer wearer;
  wearer.link();
  wearer.condition.flags = wire::kHasProfile;
  CHECK(wearer.hear(wearer.box.restore(wearer.condition.imu_id)) == Received::kNothing);
}

TEST_CASE("an unlinked wearable takes no calibration") {
  Wearer wearer;
  wearer.link();
  wearer.wait(3'100'000);
  CHECK(wearer.hear(wearer.box.restore(wearer.condition.imu_id)) == Received::kNothing);
}
