// Registers and waits of the BNO055 (datasheet BST-BNO055-DS000-14, revision 1.4).
#pragma once

#include <stdint.h>

namespace bunraku {
namespace bno055 {

enum Register : uint8_t {
  kChipId = 0x00,
  kPageId = 0x07,
  kQuaternion = 0x20,          // w, x, y, z
  kLinearAcceleration = 0x28,  // x, y, z: contiguous with the quaternion
  kGravity = 0x2E,
  kTemperature = 0x34,
  kCalibration = 0x35,
  kSystemStatus = 0x39,
  kSystemError = 0x3A,
  kUnits = 0x3B,
  kMode = 0x3D,
  kPower = 0x3E,
  kTrigger = 0x3F,
  kAxisMap = 0x41,
  kAxisSign = 0x42,
  kOffsets = 0x55,             // accelerometer, magnetometer, gyroscope, radii
  kPage1UniqueId = 0x50,
};

constexpr uint8_t kChipIdValue = 0xA0;
constexpr uint8_t kConfigMode = 0x00;
constexpr uint8_t kModeBits = 0x0F;
constexpr uint8_t kMetric = 0x00;          // UNIT_SEL as we set it: m/s^2, degrees
constexpr uint8_t kUnitsAtPowerOn = 0x80;  // so that a chip that has lost its settings is known by it
constexpr uint8_t kTriggerReset = 0x20;
constexpr uint8_t kTriggerCrystal = 0x80;
constexpr uint8_t kStatusError = 1;
constexpr uint8_t kStatusFusion = 5;
constexpr uint8_t kErrorConfiguration = 9;  // fusion refuses its configuration: a radius out of range
constexpr uint8_t kOffsetBytes = 22;
constexpr uint8_t kIdBytes = 16;
constexpr uint8_t kAxisMapPlain = 0x24, kAxisSignPlain = 0x00;

constexpr uint32_t kStartUpUs = 400000;    // table 0-2, from power-on
constexpr uint32_t kResetUs = 650000;      // table 0-2, from reset
constexpr uint32_t kToConfigUs = 20000;    // table 3-6: 19 ms
constexpr uint32_t kToFusionUs = 8000;     // table 3-6: 7 ms
constexpr uint32_t kCrystalUs = 50000;     // not in the datasheet; 10 ms have been seen to be too few

// The value of two registers, the low one first.
inline int16_t value(const uint8_t* at) { return static_cast<int16_t>(at[0] | at[1] << 8); }

}  // namespace bno055
}  // namespace bunraku
