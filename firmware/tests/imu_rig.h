// A driver on a simulated BNO055 in virtual time, called as the wearable calls it; its readings are judged.
#pragma once

#include <doctest/doctest.h>

#include <algorithm>

#include "bno055.h"
#include "bno055_model.h"
#include "dancing_arm.h"
#include "schedule.h"

namespace bunraku {

// A sound calibration profile: registers 0x55 to 0x6A.
struct Offsets {
  uint8_t bytes[22] = {7, 0, 0xF3, 0xFF, 0xF2, 0xFF, 9, 0, 4, 0, 200, 0, 3, 0, 2, 0, 1, 0, 0xE8, 3, 0xF4, 1};
  void set(size_t at, int value) {
    bytes[at] = static_cast<uint8_t>(value);
    bytes[at + 1] = static_cast<uint8_t>(value >> 8);
  }
};

struct ImuRig {
  static constexpr ImuSettings kPlain{Fusion::kImuPlus, 0x24, 0x00};
  static constexpr ImuSettings kNdof{Fusion::kNdof, 0x24, 0x00};
  static constexpr double kSlackDegrees = 1.9;  // what a torn byte weighs

  explicit ImuRig(uint64_t seed = 1, uint64_t start_us = 1000000) : clock(start_us), model(clock, seed) {}

  void power_on(const ImuSettings& settings = kPlain) {
    imu.start(settings, clock.micros());
    schedule.start(clock.micros(), 20000);
  }

  void run(double seconds, uint32_t loop_us = 700) {
    const uint64_t end_us = clock.now_us() + static_cast<uint64_t>(seconds * 1e6);
    while (clock.now_us() < end_us) turn(loop_us);
  }

  // Until it runs and a reading was believed; the virtual seconds that it took, or the limit.
  double run_until_reading(double limit_s = 10) {
    const uint64_t begun_us = clock.now_us();
    const uint32_t before = readings;
    while (readings == before && clock.now_us() < begun_us + static_cast<uint64_t>(limit_s * 1e6)) turn(700);
    return static_cast<double>(clock.now_us() - begun_us) * 1e-6;
  }

  void turn(uint32_t loop_us) {
    const uint32_t before = model.counts().transactions + model.counts().recovers;
    const uint64_t stepped_us = clock.now_us();
    imu.step(clock.micros());
    const uint32_t transactions = model.counts().transactions + model.counts().recovers - before;
    most_transactions = std::max(most_transactions, transactions);
    longest_step_us = std::max(longest_step_us, clock.now_us() - stepped_us);
    const uint32_t slot_us = schedule.next_us();
    if (schedule.is_due(clock.micros())) {
      latest_us = std::max(latest_us, clock.micros() - slot_us);
      judge();
    }
    int16_t linear[3];
    if (imu.acceleration(linear)) {
      ++accelerations;
      for (const int16_t part : linear) hardest = std::max<int>(hardest, std::abs(int{part}));
    }
    clock.advance(loop_us);
  }

  // A believed reading must be what fusion said, and a fusion restart must show in `recoveries`.
  void judge() {
    const Quaternion newest = model.newest(), previous = model.previous();
    const uint64_t begun_us = clock.now_us();
    if (!imu.sample(clock.micros(), sample)) return;
    ++readings;
    longest_gap_us = std::max(longest_gap_us, begun_us - read_us);
    read_us = begun_us;
    const bool has_previous = previous != Quaternion{0, 0, 0, 0};
    const double slack = kSlackDegrees + (has_previous ? degrees_between(newest, previous) : 0);
    worst_degrees = std::max(worst_degrees, degrees_between(newest, quaternion(sample.orientation)) - slack);
    if (starts != 0 && starts != model.counts().fusion_starts) CHECK(imu.recoveries() != recoveries);
    if (starts == model.counts().fusion_starts) CHECK(imu.recoveries() == recoveries);
    starts = model.counts().fusion_starts;
    recoveries = imu.recoveries();
  }

  void check_manners() const {  // what must hold whatever the faults
    CHECK(most_transactions <= 1);
    CHECK(longest_step_us < 6000);
    CHECK(worst_degrees <= 0);
    CHECK(model.counts().early_accesses == 0);
    CHECK(model.counts().illegal_writes == 0);
    CHECK(model.counts().illegal_reads == 0);
  }

  VirtualClock clock;
  Bno055Model model;
  Bno055 imu{model};
  Schedule schedule;
  Sample sample = {};
  uint32_t readings = 0;
  uint32_t accelerations = 0;
  int hardest = 0;
  uint32_t most_transactions = 0;
  uint32_t starts = 0;
  uint8_t recoveries = 0;
  uint64_t longest_step_us = 0;
  uint64_t read_us = clock.now_us();
  uint64_t longest_gap_us = 0;
  uint32_t latest_us = 0;  // a sample behind its slot
  double worst_degrees = -1;
};

}  // namespace bunraku
