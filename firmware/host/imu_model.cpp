// Faults, motion and knocks of a simulated chip, whichever it is.
#include "imu_model.h"

#include "rotation.h"

namespace bunraku {
namespace {

constexpr double kTapUs = 20'000;          // the chips' low-pass at some 60 Hz makes a knock that long
constexpr uint32_t kByteTenthsUs = 225;    // nine bits at 400 kHz: 22.5 us
constexpr uint32_t kStuckUs = 1000;        // what the board's driver waits on a held line
constexpr uint32_t kRecoverUs = 100;

}  // namespace

ImuModel::ImuModel(VirtualClock& clock, uint64_t seed, uint8_t address)
    : clock_(clock), random_(seed), address_(address) {
  for (uint8_t& byte : unique_id_) byte = static_cast<uint8_t>(random_.next());
  set_orientation({1, 0, 0, 0});
}

void ImuModel::set_orientation(const Quaternion& world_from_chip) {
  motion_ = [world_from_chip](uint64_t) { return world_from_chip; };
}

void ImuModel::tap(uint64_t at_us, double peak_m_s2) {
  if (taps_.size() >= 16) taps_.pop_front();
  taps_.push_back({at_us, peak_m_s2});
}

double ImuModel::linear_z(uint64_t at_us) const {
  double sum = 0;
  for (const Tap& knock : taps_) {
    const double since_us = static_cast<double>(at_us) - static_cast<double>(knock.at_us);
    if (since_us >= 0 && since_us < kTapUs) sum += knock.peak_m_s2 * std::sin(kPi * since_us / kTapUs);
  }
  return sum;
}

void ImuModel::inject(ImuFault fault, uint32_t times) {
  settle();
  pending_[static_cast<size_t>(fault)] += times;
  strike_states();
}

void ImuModel::set_probability(ImuFault fault, double per_transaction) {
  probability_[static_cast<size_t>(fault)] = per_transaction;
}

void ImuModel::recover() {
  ++counts_.recovers;
  is_stuck_ = false;
  clock_.advance(kRecoverUs);
}

bool ImuModel::is_reached(uint8_t address) {
  settle();
  ++counts_.transactions;
  strike_states();
  const bool is_meant = is_powered_ && address == address_;
  if (strikes(ImuFault::kStuckBus, true)) is_stuck_ = true;
  if (is_stuck_) {
    clock_.advance(kStuckUs);
    return false;
  }
  const bool is_off = clock_.now_us() < answers_us_;
  if (is_meant && is_off) ++(is_commanded_reset_ ? counts_.early_accesses : counts_.start_up_accesses);
  if (!is_meant || is_off || strikes(ImuFault::kNack, true)) {
    spend(1);
    return false;
  }
  return true;
}

bool ImuModel::strikes(ImuFault fault, bool can_strike) {
  const size_t at = static_cast<size_t>(fault);
  const bool is_chance = random_.happens(probability_[at]);
  const bool is_pending = can_strike && pending_[at] > 0;
  if (is_pending) --pending_[at];
  if (is_chance || is_pending) ++counts_.injected[at];
  return is_chance || is_pending;
}

void ImuModel::spend(uint32_t bytes) {
  clock_.advance(bytes * stretch_us_byte + (bytes * kByteTenthsUs + 5) / 10);
}

}  // namespace bunraku
