// The loop of the sketch, with everything around it that the sketch cannot see.
#include "world.h"

#include <algorithm>

#include "bno055_model.h"
#include "bno085_model.h"
#include "lsm6dsv_model.h"

namespace bunraku {
namespace {

constexpr uint64_t kTurnUs[2] = {120, 280};  // one turn of loop() beside what the ports cost
constexpr uint64_t kBootUs = 30'000;         // from power to begin(), by the boot loader

uint64_t lot(uint64_t seed, uint64_t which) { return Random(seed * 8 + which).next(); }

std::unique_ptr<ImuModel> chip_of(Wired wired, VirtualClock& clock, uint64_t seed) {
  if (wired == Wired::kLsm6dsv) return std::make_unique<Lsm6dsvModel>(clock, seed);
  if (wired == Wired::kBno085) return std::make_unique<Bno085Model>(clock, seed);
  return std::make_unique<Bno055Model>(clock, seed);
}

}  // namespace

World::World(uint64_t seed, uint64_t start_us, Wired wired)
    : clock(start_us), wifi(clock, lot(seed, 1)), board(clock, lot(seed, 2)),
      chip(chip_of(wired, clock, lot(seed, 3))), imu(*chip), wired_(wired), loop_(lot(seed, 4)),
      until_us_(start_us) {
  imu.set_motion([this](uint64_t at_us) { return hand.at(at_us); });
  imu.power_off();
}

void World::power(bool is_on) {
  if (is_on == this->is_on()) return;
  forget_what_was_ahead();
  wearable_.reset();
  wifi.leave();
  led.set(false);
  if (is_on) {
    imu.power_on();
    ++counts.power_ons;
    boot();
  } else {
    imu.power_off();
  }
}

void World::step_until(uint64_t us) {
  until_us_ = std::max(until_us_, us);
  if (!wearable_) clock.advance_to(us);
  while (clock.now_us() < us) turn();
}

Status World::status() const {
  Status then = clock.now_us() > until_us_ ? before_ : wearable_->status();
  if (wifi.is_joining(until_us_)) {
    then.state = State::kJoining;
    then.lane = Lane::kNone;
  }
  return then;
}

void World::turn() {
  const uint64_t began_us = clock.now_us();
  before_ = wearable_->status();
  wearable_->step();
  if (before_.state == State::kLinked && wearable_->status().state == State::kLinked) {
    counts.longest_linked_step_us = std::max(counts.longest_linked_step_us, clock.now_us() - began_us);
  }
  board.notice();
  if (board.has_bitten() || board.wants_restart()) {
    ++(board.has_bitten() ? counts.watchdog_bites : counts.restarts);
    wifi.leave();
    led.set(false);
    boot();
  }
  clock.advance(loop_.between(kTurnUs[0], kTurnUs[1]));
}

// The power was cut while a call blocked: what came after that moment never happened.
void World::forget_what_was_ahead() {
  if (clock.now_us() <= until_us_) return;
  clock = VirtualClock(until_us_);
  wifi.forget_after(until_us_);
  led.forget_after(until_us_);
}

void World::boot() {
  clock.advance(kBootUs);
  booted_at_us_ = clock.now_us();
  board_clock.power_on(first_micros);
  board.power_on();
  bno055_ = std::make_unique<Bno055>(imu);
  any_imu_ = std::make_unique<AnyImu>(imu);
  Imu& driver = wired_ == Wired::kBno055 ? static_cast<Imu&>(*bno055_) : *any_imu_;
  wearable_ = std::make_unique<Wearable>(Ports{board_clock, driver, wifi, serial, flash, led, board});
  wearable_->begin();
  before_ = wearable_->status();
}

}  // namespace bunraku
