// The simulated LSM6DSV: its bus, and what it measures.
#include "lsm6dsv_model.h"

#include <string.h>

#include <algorithm>

#include "lsm6dsv_registers.h"
#include "rotation.h"

namespace bunraku {
namespace {

using namespace lsm6dsv;

constexpr size_t kMostWords = 511;
constexpr double kGravity = 9.80665;
constexpr double kLargestBias = 0.4;  // degrees/s, of each axis
constexpr double kRateNoise = 0.1, kNoise = 0.02;  // degrees/s and m/s^2, evenly to both sides

Vector body_of(const Quaternion& q, const Vector& world) {
  const Quaternion there = product(product({q[0], -q[1], -q[2], -q[3]}, {0, world[0], world[1], world[2]}), q);
  return {there[1], there[2], there[3]};
}

}  // namespace

Lsm6dsvModel::Lsm6dsvModel(VirtualClock& clock, uint64_t seed, uint8_t address) : ImuModel(clock, seed, address) {
  const auto within = [this](double most) {
    return most * (static_cast<double>(random_.between(0, 2000)) / 1000 - 1);
  };
  for (double& bias : bias_) bias = within(kLargestBias);
  fine_ = static_cast<int8_t>(random_.between(0, 20)) - 10;
  power_on();
}

void Lsm6dsvModel::power_on() {
  is_powered_ = true;
  is_stuck_ = false;
  is_dry_ = is_frozen_ = false;
  reset_registers();
  answers_us_ = clock_.now_us() + kStartUpUs;
}

void Lsm6dsvModel::reset_registers() {
  registers_.fill(0);
  registers_[kWhoAmI] = kIdentity;
  registers_[kControl] = kControlAsTold;
  registers_[kFrequencyFine] = static_cast<uint8_t>(fine_);
  fifo_.clear();
  has_overrun_ = is_frozen_ = is_dry_ = false;
  next_us_ = 0;
}

bool Lsm6dsvModel::is_filling() const {
  return registers_[kGyroscope] == k240Hz && registers_[kAccelerometer] == k120Hz &&
         registers_[kFifoRates] == kBothRates && registers_[kFifoMode] == kContinuous && !is_dry_;
}

double Lsm6dsvModel::period_us() const { return 1e6 / 240 / (1 + 0.0013 * fine_); }

void Lsm6dsvModel::settle() {
  const uint64_t now_us = clock_.now_us();
  if (!is_powered_ || now_us < answers_us_) return;
  is_commanded_reset_ = false;
  if (!is_filling()) {
    next_us_ = 0;
    return;
  }
  if (next_us_ == 0) {
    next_us_ = static_cast<double>(now_us) + period_us();
    ++counts_.fusion_starts;  // the board's fusion begins with them
  }
  while (next_us_ <= static_cast<double>(now_us)) {
    measure(static_cast<uint64_t>(next_us_));
    next_us_ += period_us();
  }
}

// The mean rate since the last, exactly; and with every second of them what the accelerometer feels.
void Lsm6dsvModel::measure(uint64_t at_us) {
  const Quaternion now = motion_(at_us), before = motion_(at_us - static_cast<uint64_t>(period_us()));
  Quaternion turn = product({before[0], -before[1], -before[2], -before[3]}, now);
  if (turn[0] < 0) {
    for (double& part : turn) part = -part;
  }
  const double half_sine = std::sqrt(turn[1] * turn[1] + turn[2] * turn[2] + turn[3] * turn[3]);
  const double scale = half_sine > 1e-12 ? 2 * std::atan2(half_sine, turn[0]) / half_sine : 2;
  const double a_second = 1e6 / period_us() * 180 / kPi;
  const auto noise = [this](double most) {
    return most * (static_cast<double>(random_.between(0, 2000)) / 1000 - 1);
  };
  const Vector up = body_of(now, {0, 0, 1});
  Vector rate, force;
  for (size_t i = 0; i < 3; ++i) {
    rate[i] = turn[1 + i] * scale * a_second + bias_[i] + up[i] * drift_degrees_minute / 60 + noise(kRateNoise);
    force[i] = kGravity * up[i] + (i == 2 ? linear_z(at_us) : 0) + noise(kNoise);
  }
  push(kGyroscopeTag, {rate[0] / 0.070, rate[1] / 0.070, rate[2] / 0.070});
  if (++samples_ % 2 != 0) return;
  const double step = kGravity * 0.000244;
  push(kAccelerometerTag, {force[0] / step, force[1] / step, force[2] / step});
}

void Lsm6dsvModel::push(uint8_t tag, const std::array<double, 3>& steps) {
  Word word{static_cast<uint8_t>(tag << 3)};
  for (size_t i = 0; i < 3; ++i) {
    const long bits = std::clamp(std::lround(steps[i]), -32768L, 32767L);
    word[1 + 2 * i] = static_cast<uint8_t>(bits);
    word[2 + 2 * i] = static_cast<uint8_t>(bits >> 8);
  }
  Word& last = last_[tag - 1];
  if (is_frozen_) word = last;
  last = word;
  if (fifo_.size() >= kMostWords) {
    fifo_.pop_front();
    has_overrun_ = true;
  }
  fifo_.push_back(word);
}

uint8_t Lsm6dsvModel::read_byte(uint8_t reg) {
  const size_t words = fifo_.size();
  if (reg == kFifoStatus) return static_cast<uint8_t>(words);
  if (reg == kFifoStatus + 1) {
    const uint8_t overrun = has_overrun_ ? 0x08 : 0;
    has_overrun_ = false;
    return static_cast<uint8_t>(overrun | (words >> 8 & 1));
  }
  return registers_[reg];
}

bool Lsm6dsvModel::read(uint8_t address, uint8_t reg, uint8_t* data, uint8_t count) {
  if (!is_reached(address)) return false;
  if (reg >= registers_.size() || (reg != kFifoTag && reg + count > kFifoTag)) ++counts_.illegal_reads;
  const bool is_data = reg == kFifoTag && count >= kWordBytes;
  for (uint8_t i = 0; i < count; ++i) {
    if (reg != kFifoTag) {
      data[i] = read_byte(static_cast<uint8_t>(reg + i));
      continue;
    }
    data[i] = fifo_.empty() ? 0 : fifo_.front()[i % kWordBytes];
    if (i % kWordBytes == kWordBytes - 1 && !fifo_.empty()) fifo_.pop_front();
  }
  if (strikes(ImuFault::kTornRead, is_data)) data[random_.between(0, count - 1u)] ^= 0x11;
  if (strikes(ImuFault::kFlippedBit, is_data) && is_data) data[2 + 2 * random_.between(0, 2)] ^= 0x80;
  if (strikes(ImuFault::kZeroRead, is_data)) memset(data, 0, count);
  spend(3u + count);
  return true;
}

bool Lsm6dsvModel::write(uint8_t address, uint8_t reg, const uint8_t* data, uint8_t count) {
  if (!is_reached(address)) return false;
  spend(2u + count);
  settle();
  const bool is_setting = reg == kFifoRates || reg == kFifoMode || reg == kAccelerometer || reg == kGyroscope ||
                          reg == kControl || reg == kGyroscopeRange || reg == kAccelerometerRange;
  if (count != 1 || !is_setting) {
    ++counts_.illegal_writes;
    return true;
  }
  if (reg == kControl && (data[0] & kReset) != 0) {
    ++counts_.resets;
    reset_registers();
    is_commanded_reset_ = true;
    answers_us_ = clock_.now_us() + kStartUpUs;
    return true;
  }
  registers_[reg] = data[0];
  settle();
  return true;
}

void Lsm6dsvModel::strike_states() {
  if (strikes(ImuFault::kBrownOut, true)) power_on();
  if (strikes(ImuFault::kSilentConfig, true)) registers_[kGyroscope] = registers_[kAccelerometer] = 0;
  if (strikes(ImuFault::kFrozen, true)) is_frozen_ = true;
  if (strikes(ImuFault::kFusionError, true)) is_dry_ = true;
}

}  // namespace bunraku
