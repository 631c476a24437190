// The gate: refuses what no hand can do, accepts every hand, and locks none out.
#include <doctest/doctest.h>

#include <cmath>

#include "imu_rig.h"

namespace bunraku {
namespace {

using Verdict = ImuGate::Verdict;

struct Q14 {
  int16_t parts[4];
};

Q14 q14(const Quaternion& q) {
  Q14 out;
  for (size_t i = 0; i < 4; ++i) out.parts[i] = static_cast<int16_t>(std::lround(q[i] * 16384));
  return out;
}

Quaternion random_orientation(Random& random) {
  return turned(random.share() * 360, random.share() - 0.5, random.share() - 0.5, random.share() - 0.4999);
}

Quaternion after(const Quaternion& a, const Quaternion& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

struct Gate : ImuGate {
  Verdict admit(const Quaternion& q, uint32_t now_us) { return ImuGate::admit(q14(q).parts, now_us); }
  void settle(const Quaternion& q, uint32_t now_us) {
    admit(q, now_us - 20000);
    REQUIRE(admit(q, now_us) == Verdict::kAccepted);
  }
};

}  // namespace

TEST_CASE("zero and wrong norms are refused, whatever came before") {
  Gate gate;
  CHECK(gate.admit({0, 0, 0, 0}, 0) == Verdict::kZero);
  CHECK(gate.admit({0.3, 0.3, 0, 0}, 0) == Verdict::kZero);
  CHECK(gate.admit({0.98, 0, 0, 0}, 0) == Verdict::kNorm);
  CHECK(gate.admit({1.009, 0.2, 0, 0}, 0) == Verdict::kNorm);
  const int16_t extreme[4] = {-32768, -32768, -32768, -32768};
  CHECK(gate.ImuGate::admit(extreme, 0) == Verdict::kNorm);
}

TEST_CASE("the first reading is believed when the next agrees with it") {
  Gate gate;
  CHECK(gate.admit({1, 0, 0, 0}, 0) == Verdict::kUnconfirmed);
  CHECK(gate.admit(turned(160, 0, 1, 0), 20000) == Verdict::kUnconfirmed);
  CHECK(gate.admit(turned(162, 0, 1, 0), 40000) == Verdict::kAccepted);
  SUBCASE("a flipped bit confirms nothing") {
    gate.reset();
    const Quaternion still = turned(6, 1, 0, 0);
    Q14 flipped = q14(still);
    flipped.parts[0] = static_cast<int16_t>(flipped.parts[0] - 32768);
    CHECK(gate.admit(still, 60000) == Verdict::kUnconfirmed);
    CHECK(gate.ImuGate::admit(flipped.parts, 80000) == Verdict::kUnconfirmed);
    CHECK(gate.admit(still, 100000) == Verdict::kAccepted);
  }
}

TEST_CASE("no hand is refused: up to 2000 degrees/s, any orientation, across the wrap") {
  for (uint64_t seed = 1; seed <= 300; ++seed) {
    Random random(seed);
    Gate gate;
    Quaternion q = random_orientation(random);
    uint32_t now_us = static_cast<uint32_t>(random.next());
    gate.settle(q, now_us);
    for (int i = 0; i < 50; ++i) {
      const uint32_t interval_us = static_cast<uint32_t>(random.between(10000, 40000));
      const double degrees = 2000 * interval_us * 1e-6 * random.share();
      q = after(turned(degrees, random.share() - 0.5, random.share() - 0.5, 0.1), q);
      now_us += interval_us;
      REQUIRE(gate.admit(q, now_us) == Verdict::kAccepted);
    }
  }
}

TEST_CASE("a change of the sign is no turn: it passes, or costs 0.1 s where it could be a flipped bit") {
  for (uint64_t seed = 1; seed <= 300; ++seed) {
    Random random(seed);
    Gate gate;
    gate.settle(dance(100000), 100000);
    double sign = 1;
    uint32_t refused = 0, longest = 0, total = 0;
    for (uint32_t now_us = 120000; now_us < 5000000; now_us += 20000) {
      if (random.happens(0.05)) sign = -sign;
      Quaternion q = dance(now_us);
      for (double& part : q) part *= sign;
      refused = is_believed(gate.admit(q, now_us)) ? 0 : refused + 1;
      longest = std::max(longest, refused);
      total += refused > 0;
    }
    CHECK(longest <= 4);
    CHECK(total <= 8);
  }
}

TEST_CASE("faster than any hand is refused") {
  for (uint64_t seed = 1; seed <= 300; ++seed) {
    Random random(seed);
    Gate gate;
    const Quaternion q = random_orientation(random);
    gate.settle(q, 100000);
    const double allowed = 3 + 2000 * 0.020;
    const double degrees = allowed * 1.04 + random.share() * 100;
    const Quaternion jump = after(turned(degrees, random.share() - 0.5, 1, 0.2), q);
    CHECK(gate.admit(jump, 120000) == Verdict::kRate);
    CHECK(gate.admit(q, 140000) == Verdict::kAccepted);
  }
}

TEST_CASE("a flipped top bit never passes, and costs no other reading") {
  for (uint64_t seed = 1; seed <= 5000; ++seed) {
    Random random(seed);
    Gate gate;
    const Quaternion q = turned(random.share() * (seed % 2 == 0 ? 360 : 15), random.share() - 0.5, 0.3, 0.1);
    gate.settle(q, 100000);
    const Quaternion moved = after(turned(random.share() * 30, 0.2, random.share() - 0.5, 1), q);
    Q14 flipped = q14(moved);
    int16_t& part = flipped.parts[random.between(0, 3)];
    part = static_cast<int16_t>(part ^ 0x8000);
    REQUIRE_FALSE(is_believed(gate.ImuGate::admit(flipped.parts, 120000)));
    REQUIRE(gate.admit(moved, 140000) == Verdict::kAccepted);
  }
}

TEST_CASE("what has truly moved is believed after five readings, or half a second of silence") {
  Gate gate;
  gate.settle({1, 0, 0, 0}, 100000);
  uint32_t now_us = 100000;
  for (int i = 0; i < 4; ++i) CHECK(gate.admit(turned(170, 0, 1, 0), now_us += 20000) == Verdict::kRate);
  CHECK(gate.admit(turned(170, 0, 1, 0), now_us += 20000) == Verdict::kRelocated);
  SUBCASE("silence") {
    CHECK(gate.admit({1, 0, 0, 0}, now_us += 500001) == Verdict::kUnconfirmed);
    CHECK(gate.admit({1, 0, 0, 0}, now_us += 20000) == Verdict::kAccepted);
  }
}

TEST_CASE("no hand is locked out: after any nonsense, two sound readings and half a second are enough") {
  for (uint64_t seed = 1; seed <= 300; ++seed) {
    Random random(seed);
    Gate gate;
    uint32_t now_us = static_cast<uint32_t>(random.next());
    for (int i = 0; i < 100; ++i) {
      Q14 nonsense = q14(random_orientation(random));
      if (random.happens(0.5)) nonsense.parts[i % 4] = static_cast<int16_t>(random.next());
      gate.ImuGate::admit(nonsense.parts, now_us);
      now_us += static_cast<uint32_t>(random.between(0, 60000));
    }
    const uint32_t sound_us = now_us;
    while (!is_believed(gate.admit(dance(now_us), now_us)) && now_us - sound_us < 2000000) now_us += 20000;
    CHECK(now_us - sound_us <= 560000);
  }
}

}  // namespace bunraku
