// A driver whose chip reports by itself, on the simulated chip: its readings are judged by the orientation that the
// chip's fusion had at the time that the reading says.
#pragma once

#include <doctest/doctest.h>

#include "dancing_arm.h"
#include "imu.h"
#include "imu_model.h"
#include "rotation.h"
#include "schedule.h"

namespace bunraku {

template <typename Driver, typename Model>
struct ReportRig {
  static constexpr ImuSettings kPlain{Fusion::kImuPlus, 0x24, 0x00};
  static constexpr ImuSettings kNdof{Fusion::kNdof, 0x24, 0x00};

  explicit ReportRig(uint64_t seed = 1, uint64_t start_us = 1000000) : clock(start_us), model(clock, seed) {}

  void power_on(const ImuSettings& settings = kPlain, uint32_t period_us = 20000) {
    imu.start(settings, clock.micros());
    schedule.start(clock.micros(), period_us);
    field = settings.fusion == Fusion::kNdof;
  }

  void run(double seconds, uint32_t loop_us = 300) {
    const uint64_t end_us = clock.now_us() + static_cast<uint64_t>(seconds * 1e6);
    while (clock.now_us() < end_us) turn(loop_us);
  }

  double run_until_reading(double limit_s = 10) {
    const uint64_t begun_us = clock.now_us();
    const uint32_t before = readings;
    while (readings == before && clock.now_us() < begun_us + static_cast<uint64_t>(limit_s * 1e6)) turn(300);
    return static_cast<double>(clock.now_us() - begun_us) * 1e-6;
  }

  void turn(uint32_t loop_us) {
    const uint32_t before = model.counts().transactions + model.counts().recovers;
    const uint64_t stepped_us = clock.now_us();
    imu.step(clock.micros());
    most_transactions =
        std::max(most_transactions, model.counts().transactions + model.counts().recovers - before);
    longest_step_us = std::max(longest_step_us, clock.now_us() - stepped_us);
    if (schedule.is_due(clock.micros())) judge();
    int16_t linear[3];
    if (imu.acceleration(linear)) {
      ++accelerations;
      for (const int16_t part : linear) hardest = std::max<int>(hardest, std::abs(int{part}));
    }
    clock.advance(loop_us);
  }

  void judge() {
    if (!imu.sample(clock.micros(), sample)) return;
    ++readings;
    longest_gap_us = std::max(longest_gap_us, clock.now_us() - read_us);
    read_us = clock.now_us();
    const uint32_t age_us = clock.micros() - sample.measured_us;
    oldest_us = std::max(oldest_us, age_us);
    const Quaternion truth = model.fused(clock.now_us() - age_us, field);
    const Quaternion said = quaternion(sample.orientation);
    if (is_heading_free && (readings == 1 || imu.recoveries() != recoveries)) align(truth, said);
    worst_degrees = std::max(worst_degrees, degrees_between(truth, product(about_z(heading_offset), said)));
    if (starts != 0 && starts != model.counts().fusion_starts) CHECK(imu.recoveries() != recoveries);
    if (starts == model.counts().fusion_starts) CHECK(imu.recoveries() == recoveries);
    starts = model.counts().fusion_starts;
    recoveries = imu.recoveries();
  }

  // Where the board fuses, its heading is nobody's choice: the first reading says which it is.
  void align(const Quaternion& truth, const Quaternion& said) {
    const Quaternion apart = product(truth, {said[0], -said[1], -said[2], -said[3]});
    heading_offset = 2 * std::atan2(apart[3], apart[0]);
  }

  // Rules that every fault must leave intact; `slack_degrees`: the error that a damaged byte may cause.
  void check_manners(double slack_degrees = 0.5) const {
    CHECK(most_transactions <= 1);
    CHECK(longest_step_us < 3000);
    CHECK(worst_degrees <= slack_degrees);
    CHECK(model.counts().early_accesses == 0);
    CHECK(model.counts().illegal_writes == 0);
  }

  VirtualClock clock;
  Model model;
  Driver imu{model};
  Schedule schedule;
  Sample sample = {};
  bool field = false;
  bool is_heading_free = false;
  double heading_offset = 0;
  uint32_t readings = 0, accelerations = 0;
  int hardest = 0;
  uint32_t most_transactions = 0, starts = 0, oldest_us = 0;
  uint8_t recoveries = 0;
  uint64_t longest_step_us = 0, longest_gap_us = 0;
  uint64_t read_us = clock.now_us();
  double worst_degrees = 0;
};

}  // namespace bunraku
