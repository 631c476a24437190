// The bus side, the registers and the modes of the simulated BNO055; what it feels is in bno055_fusion.cpp.
#include "bno055_model.h"

#include <string.h>

#include <algorithm>
#include <utility>

#include "bno055_registers.h"

namespace bunraku {
namespace {

using namespace bno055;

constexpr uint8_t kErrorSystem = 3;         // SYS_ERR: system initialisation
constexpr uint8_t kLastOffset = kOffsets + kOffsetBytes - 1;
constexpr uint8_t kTemperatureSource = 0x40;
constexpr uint8_t kLastGyroscopeOffset = 0x66;

bool covers_data(uint8_t reg, uint8_t count) { return reg <= kQuaternion && reg + count > kQuaternion + 7; }
bool is_fusion_mode(uint8_t mode) { return mode == 0x08 || mode == 0x0B || mode == 0x0C; }

}  // namespace

Bno055Model::Bno055Model(VirtualClock& clock, uint64_t seed, uint8_t address) : ImuModel(clock, seed, address) {
  stretch_us_byte = 180;
  power_on();
}

void Bno055Model::power_on() {
  is_powered_ = true;
  is_stuck_ = is_commanded_reset_ = false;
  reset_registers();
  answers_us_ = clock_.now_us() + kStartUpUs;
}

bool Bno055Model::write(uint8_t address, uint8_t reg, const uint8_t* data, uint8_t count) {
  if (!begin(address, false, reg, count)) return false;
  spend(2u + count);
  settle();
  if (clock_.now_us() < switched_us_) return true;  // counted as early, and lost
  for (uint8_t i = 0; i < count; ++i) {
    if (!write_byte(static_cast<uint8_t>(reg + i), data[i])) ++counts_.illegal_writes;
  }
  return true;
}

bool Bno055Model::read(uint8_t address, uint8_t reg, uint8_t* data, uint8_t count) {
  if (!begin(address, true, reg, count)) return false;
  const Output seen = newest_;
  for (uint8_t i = 0; i < count; ++i) data[i] = read_byte(static_cast<uint8_t>(reg + i), seen);
  corrupt(reg, data, count);
  spend(3u + count);
  return true;
}

// Address, faults that keep the chip from answering, and waits that the host should have kept.
bool Bno055Model::begin(uint8_t address, bool is_read, uint8_t reg, uint8_t count) {
  if (!is_reached(address)) return false;
  if (clock_.now_us() < switched_us_) ++counts_.early_accesses;
  if (is_read && page_ == 0 && mode_ != kConfigMode && reg <= kLastOffset && reg + count > kOffsets) {
    ++counts_.illegal_reads;
  }
  return true;
}

void Bno055Model::strike_states() {
  if (strikes(ImuFault::kBrownOut, true)) power_on();
  if (strikes(ImuFault::kSilentConfig, true)) {
    stop_fusion();
    mode_ = next_mode_ = kConfigMode;
  }
  if (strikes(ImuFault::kFrozen, true)) is_frozen_ = true;
  if (strikes(ImuFault::kFusionError, true)) registers_[kSystemError] = kErrorSystem;
}

void Bno055Model::corrupt(uint8_t reg, uint8_t* data, uint8_t count) {
  const bool is_data = page_ == 0 && covers_data(reg, count);
  if (strikes(ImuFault::kTornRead, is_data) && count > 1) {
    const uint64_t split = random_.between(1, count - 1u);
    for (uint8_t i = 0; i < split; ++i) data[i] = read_byte(static_cast<uint8_t>(reg + i), previous_);
  }
  if (strikes(ImuFault::kFlippedBit, is_data)) {
    const uint64_t value = random_.between(0, (count - 1u) / 2);
    data[std::min<uint64_t>(2 * value + 1, count - 1u)] ^= 0x80;
  }
  if (strikes(ImuFault::kZeroRead, is_data)) memset(data, 0, count);
}

// Register map, page 0, table 4-2: what is there after power-on or reset.
void Bno055Model::reset_registers() {
  registers_.fill(0);
  const std::pair<uint8_t, uint8_t> values[] = {{kChipId, kChipIdValue},
                                                {0x01, 0xFB},
                                                {0x02, 0x32},
                                                {0x03, 0x0F},
                                                {0x04, 0x11},
                                                {0x05, 0x03},
                                                {0x06, 0x15},
                                                {0x36, 0x0F},
                                                {kUnits, kUnitsAtPowerOn},
                                                {kAxisMap, kAxisMapPlain},
                                                {0x69, 0xE0},
                                                {0x6A, 0x01}};
  for (const auto& [reg, value] : values) registers_[reg] = value;
  page_ = 0;
  mode_ = next_mode_ = kConfigMode;
  switched_us_ = 0;
  is_frozen_ = is_radius_written_ = has_learnt_ = false;
  newest_ = previous_ = Output{};
}

uint8_t Bno055Model::read_byte(uint8_t reg, const Output& data) {
  if (reg == kPageId) return page_;
  if (page_ == 1) {  // the sensors' own settings are not simulated
    return reg >= kPage1UniqueId && reg < kPage1UniqueId + kIdBytes ? unique_id_[reg - kPage1UniqueId] : 0;
  }
  if (reg >= kQuaternion && reg <= kTemperature) return data.bytes[reg - kQuaternion];
  if (reg == kCalibration) return calibration();
  if (reg == kSystemStatus) {
    return registers_[kSystemError] != 0 ? kStatusError : is_fusion_mode(mode_) ? kStatusFusion : 0;
  }
  if (reg == kMode) return mode_;
  if (reg >= kOffsets && reg <= kLastOffset && mode_ != kConfigMode) return 0;
  return reg < registers_.size() ? registers_[reg] : 0;
}

// False: not a write that the datasheet allows now.
bool Bno055Model::write_byte(uint8_t reg, uint8_t value) {
  if (reg == kPageId) {
    page_ = value & 1;
    return value <= 1;
  }
  if (page_ != 0) return false;
  if (reg == kMode) return write_mode(value & kModeBits);
  if (mode_ != kConfigMode) return false;
  if (reg == kTrigger) return write_trigger(value);
  const bool is_offset = reg >= kOffsets && reg <= kLastOffset;
  const bool is_axes = reg == kAxisMap || reg == kAxisSign;
  const bool is_setting = is_axes || reg == kUnits || reg == kPower || reg == kTemperatureSource;
  if (!is_offset && !is_setting) return false;
  if (reg == kAxisMap) {
    const uint8_t axes[3] = {static_cast<uint8_t>(value & 3), static_cast<uint8_t>(value >> 2 & 3),
                             static_cast<uint8_t>(value >> 4 & 3)};
    if ((1u << axes[0] | 1u << axes[1] | 1u << axes[2]) != 7) return false;
  }
  registers_[reg] = value;
  if (reg == kLastGyroscopeOffset) has_learnt_ = true;
  if (reg == kLastOffset) is_radius_written_ = true;
  return true;
}

bool Bno055Model::write_mode(uint8_t mode) {
  if (mode == mode_) return true;
  if (mode != kConfigMode && (mode_ != kConfigMode || !is_fusion_mode(mode))) return false;
  if (mode == kConfigMode) stop_fusion();
  next_mode_ = mode;
  switched_us_ = clock_.now_us() + (mode == kConfigMode ? kToConfigUs : kToFusionUs);
  return true;
}

bool Bno055Model::write_trigger(uint8_t value) {
  if ((value & kTriggerReset) != 0) {
    ++counts_.resets;
    reset_registers();
    is_commanded_reset_ = true;
    answers_us_ = clock_.now_us() + kResetUs;
    return true;
  }
  registers_[kTrigger] = has_crystal ? value & kTriggerCrystal : 0;
  return (value & 0x5E) == 0;
}

// The chip's events since the last look.
void Bno055Model::settle() {
  const uint64_t now_us = clock_.now_us();
  if (!is_powered_ || now_us < answers_us_) return;
  is_commanded_reset_ = false;
  if (next_mode_ != mode_ && now_us >= switched_us_) {
    mode_ = next_mode_;
    if (mode_ != kConfigMode) start_fusion(switched_us_);
  }
  fuse(now_us);
}

bool Bno055Model::is_fusing() {
  settle();
  const bool is_up = is_powered_ && clock_.now_us() >= answers_us_;
  return is_up && is_fusion_mode(mode_) && registers_[kSystemError] == 0;
}

uint8_t Bno055Model::peek(uint8_t reg) {
  settle();
  const uint8_t page = std::exchange(page_, uint8_t{0});
  const uint8_t value = read_byte(reg, newest_);
  page_ = page;
  return value;
}

}  // namespace bunraku
