// A BNO055 small enough for the micro:bit.
#include "scripted_imu.h"

#include <string.h>

namespace bunraku {
namespace {

using namespace bno055;

constexpr uint8_t kAddress = 0x28;
constexpr uint32_t kByteUs = 205;      // at 400 kHz, with the chip's clock stretching
constexpr uint32_t kUpdateUs = 10000;  // fusion data at 100 Hz
constexpr uint32_t kTurnUpdates = 400;  // a turn forth and back takes four seconds
constexpr int32_t kLargestZ = 8000;     // of 16384: 58 degrees to each side
constexpr uint8_t kFullyCalibrated = 0x3F;

int16_t root(uint32_t square) {
  uint32_t root = 0;
  for (uint32_t bit = 1u << 15; bit != 0; bit >>= 1) {
    if ((root + bit) * (root + bit) <= square) root += bit;
  }
  return static_cast<int16_t>(root);
}

}  // namespace

bool ScriptedImu::write(uint8_t address, uint8_t reg, const uint8_t* data, uint8_t count) {
  if (!answers(address, count)) return false;
  memcpy(registers_ + reg, data, count);
  if (reg == kTrigger && (data[0] & kTriggerReset)) is_alive_ = false, alive_at_us_ = now_us_ + kResetUs;
  registers_[kSystemStatus] = (registers_[kMode] & kModeBits) == kConfigMode ? 0 : kStatusFusion;
  return true;
}

bool ScriptedImu::read(uint8_t address, uint8_t reg, uint8_t* data, uint8_t count) {
  if (!answers(address, count)) return false;
  if (registers_[kPageId] == 0) fuse();
  memcpy(data, registers_ + reg, count);
  if (registers_[kPageId] == 1 && reg == kPage1UniqueId) memset(data, 0x5A, count);
  return true;
}

bool ScriptedImu::answers(uint8_t address, uint8_t count) {
  now_us_ += kByteUs * (count + 2u);
  if (address != kAddress || static_cast<int32_t>(now_us_ - alive_at_us_) < 0) return false;
  if (!is_alive_) reset();
  return true;
}

void ScriptedImu::reset() {
  memset(registers_, 0, sizeof registers_);
  registers_[kChipId] = kChipIdValue;
  registers_[kUnits] = kUnitsAtPowerOn;
  registers_[kAxisMap] = kAxisMapPlain;
  is_alive_ = true;
}

// z swings evenly between its ends, w keeps the length: a quaternion without a table of sines.
void ScriptedImu::fuse() {
  if (registers_[kSystemStatus] != kStatusFusion) return;
  const int32_t step = static_cast<int32_t>(now_us_ / kUpdateUs % kTurnUpdates);
  const int32_t half = kTurnUpdates / 2;
  const int32_t swing = step < half ? step : static_cast<int32_t>(kTurnUpdates) - step;
  const int32_t z = swing * 2 * kLargestZ / half - kLargestZ;
  const int16_t orientation[4] = {root(static_cast<uint32_t>((1 << 28) - z * z)), 0, 0, static_cast<int16_t>(z)};
  memcpy(registers_ + kQuaternion, orientation, sizeof orientation);
  registers_[kCalibration] = kFullyCalibrated;
}

}  // namespace bunraku
