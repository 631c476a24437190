// Words of CEVA's SH-2 over SHTP, as the BNO085 and BNO086 speak them (SH-2 Reference Manual 1.4, SHTP 1.7, BNO08X
// datasheet 1.16).
#pragma once

#include <stdint.h>

namespace bunraku {
namespace sh2 {

enum Channel : uint8_t { kAdvertisements = 0, kExecutable = 1, kControl = 2, kInput = 3 };

enum Report : uint8_t {
  kGyroscope = 0x02,
  kMagneticField = 0x03,
  kLinearAcceleration = 0x04,
  kRotationVector = 0x05,
  kGameRotationVector = 0x08,
};

enum Message : uint8_t {
  kCommandResponse = 0xF1,
  kCommandRequest = 0xF2,
  kFrsResponse = 0xF3,
  kFrsRequest = 0xF4,
  kProductResponse = 0xF8,
  kProductRequest = 0xF9,
  kTimeRebase = 0xFA,
  kTimeBase = 0xFB,
  kFeatureResponse = 0xFC,
  kSetFeature = 0xFD,
  kFeatureRequest = 0xFE,
};

constexpr uint8_t kReset = 1, kResetComplete = 1;  // on the executable channel, there and back
constexpr uint8_t kSaveCalibration = 0x06, kSetCalibration = 0x07;  // commands
constexpr uint16_t kSerialNumber = 0x4B4B, kDynamicCalibration = 0x1F1F;  // records in the chip's flash
constexpr uint8_t kFrsStatusBits = 0x0F, kFrsNoError = 0, kFrsBusy = 2, kFrsRecordRead = 3, kFrsEmpty = 5,
                  kFrsBlockRead = 6, kFrsBlockAndRecordRead = 7;

constexpr uint8_t kHeaderBytes = 4;
constexpr uint8_t kFeatureBytes = 17, kCommandBytes = 12, kCommandResponseBytes = 16, kFrsRequestBytes = 8;
constexpr uint8_t kFrsResponseBytes = 16, kProductRequestBytes = 2, kProductResponseBytes = 16;
constexpr uint8_t kFeatureRequestBytes = 2, kTimeBaseBytes = 5, kVectorBytes = 10;
constexpr uint8_t kGameRotationBytes = 12, kRotationBytes = 14;
constexpr uint16_t kContinued = 0x8000;  // in a header's length: the rest of a cargo
constexpr uint8_t kAccuracyBits = 0x03;  // in a report's third byte; above it the upper bits of its delay
constexpr uint32_t kTickUs = 100;  // the unit of time bases and delays

constexpr uint8_t kAddress = 0x4A, kOtherAddress = 0x4B;  // the pin SA0 chooses
constexpr uint32_t kStartUpUs = 150000;  // datasheet 6.5.3: 94 ms from reset to the first cargo
constexpr uint32_t kResetUs = 200000;

inline uint16_t value(const uint8_t* at) { return static_cast<uint16_t>(at[0] | at[1] << 8); }
inline int16_t signed_value(const uint8_t* at) { return static_cast<int16_t>(value(at)); }
inline uint32_t long_value(const uint8_t* at) { return value(at) | static_cast<uint32_t>(value(at + 2)) << 16; }

}  // namespace sh2
}  // namespace bunraku
