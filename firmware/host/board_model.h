// The rest of the board: its clock since power-on, its lamp, its battery, its noise, and the watchdog.
#pragma once

#include <algorithm>
#include <deque>

#include "ports.h"
#include "random.h"
#include "virtual_clock.h"

namespace bunraku {

// The board's own clock: starts at zero at each power-on, and runs a little fast or slow.
class BoardClock : public Clock {
 public:
  explicit BoardClock(VirtualClock& world) : world_(world) {}

  uint32_t micros() override { return static_cast<uint32_t>(since_power_on_us()); }
  void power_on(uint64_t start_us) {  // what the clock shows now
    powered_on_us_ = world_.now_us();
    start_us_ = start_us;
  }
  uint64_t since_power_on_us() const {
    const double elapsed_us = static_cast<double>(world_.now_us() - powered_on_us_);
    return start_us_ + static_cast<uint64_t>(elapsed_us * (1 + drift_ppm * 1e-6));
  }

  double drift_ppm = 0;  // how much too fast

 private:
  VirtualClock& world_;
  uint64_t powered_on_us_ = 0;
  uint64_t start_us_ = 0;
};

class LedTrace : public Led {
 public:
  struct Change {
    uint64_t at_us;
    bool is_on;
  };

  explicit LedTrace(VirtualClock& clock) : clock_(clock) {}

  void set(bool is_on) override {
    if (is_on == is_on_) return;
    is_on_ = is_on;
    if (changes_.size() >= kMostUntaken) changes_.pop_front();
    changes_.push_back({clock_.now_us(), is_on});
  }
  bool is_on() const { return is_on_; }
  void forget_after(uint64_t at_us) {
    while (!changes_.empty() && changes_.back().at_us > at_us) {
      is_on_ = !changes_.back().is_on;
      changes_.pop_back();
    }
  }
  bool take(Change& change) {  // the oldest change that was not taken yet
    if (changes_.empty()) return false;
    change = changes_.front();
    changes_.pop_front();
    return true;
  }

 private:
  static constexpr size_t kMostUntaken = 65536;
  VirtualClock& clock_;
  bool is_on_ = false;
  std::deque<Change> changes_;
};

class BoardModel : public Board {
 public:
  static constexpr uint64_t kWatchdogUs = 16'000'000;  // SAMD21: the longest period

  BoardModel(VirtualClock& clock, uint64_t seed) : clock_(clock), random_(seed) {}

  uint16_t battery_millivolts() override { return millivolts; }
  void noise(uint8_t* data, uint8_t count) override {
    std::generate_n(data, count, [this] { return static_cast<uint8_t>(random_.next()); });
  }
  void feed_watchdog() override {
    notice();
    fed_at_us_ = clock_.now_us();
  }
  void restart() override { wants_restart_ = true; }
  bool was_reset_by_watchdog() override { return was_bitten_; }

  // The world's side.
  void power_on() {
    fed_at_us_ = clock_.now_us();
    was_bitten_ = has_bitten_;
    wants_restart_ = has_bitten_ = false;
  }
  void notice() {  // how long the watchdog was not fed; too long and it bites
    const uint64_t unfed_us = clock_.now_us() - fed_at_us_;
    longest_unfed_us = std::max(longest_unfed_us, unfed_us);
    if (unfed_us > kWatchdogUs) has_bitten_ = true;
  }
  bool wants_restart() const { return wants_restart_; }
  bool has_bitten() const { return has_bitten_; }

  uint16_t millivolts = 4000;
  uint64_t longest_unfed_us = 0;

 private:
  VirtualClock& clock_;
  Random random_;
  uint64_t fed_at_us_ = 0;
  bool wants_restart_ = false;
  bool has_bitten_ = false;
  bool was_bitten_ = false;  // that began this start
};

}  // namespace bunraku
