// Ranges of the datasheet: section 3.6.4, at the ranges that fusion uses (4 g, 2000 degrees/s).
#include "imu_profile.h"

#include "bno055_registers.h"

namespace bunraku {
namespace {

using bno055::value;

constexpr uint8_t kAllOffsets = 18;
constexpr int16_t kLargestAccelerometer = 4000, kLargestMagnetometer = 6400, kLargestGyroscope = 32000;
constexpr int16_t kLargestAccelerometerRadius = 1000;
constexpr int16_t kLeastMagnetometerRadius = 144, kLargestMagnetometerRadius = 1280;

bool is_within(const uint8_t* three, int16_t largest) {
  for (uint8_t i = 0; i < 6; i += 2) {
    if (value(three + i) > largest || value(three + i) < -largest) return false;
  }
  return true;
}

bool is_blank(const uint8_t* offsets) {  // never learnt, or erased flash
  for (uint8_t i = 1; i < kAllOffsets; ++i) {
    if (offsets[i] != offsets[0]) return false;
  }
  return offsets[0] == 0 || offsets[0] == 0xFF;
}

}  // namespace

uint8_t sound_profile_bytes(const uint8_t* offsets22) {
  if (is_blank(offsets22) || !is_within(offsets22, kLargestAccelerometer) ||
      !is_within(offsets22 + 6, kLargestMagnetometer) || !is_within(offsets22 + 12, kLargestGyroscope)) {
    return 0;
  }
  const int16_t accelerometer_radius = value(offsets22 + 18), magnetometer_radius = value(offsets22 + 20);
  if (accelerometer_radius <= 0 || accelerometer_radius > kLargestAccelerometerRadius) return kAllOffsets;
  const bool has_field =
      magnetometer_radius >= kLeastMagnetometerRadius && magnetometer_radius <= kLargestMagnetometerRadius;
  return has_field ? bno055::kOffsetBytes : bno055::kOffsetBytes - 2;
}

}  // namespace bunraku
