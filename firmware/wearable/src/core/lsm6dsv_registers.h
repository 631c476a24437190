// Registers of the LSM6DSV (datasheet DS13510, revision 4) as far as they are used.
#pragma once

#include <stdint.h>

namespace bunraku {
namespace lsm6dsv {

enum Register : uint8_t {
  kFifoRates = 0x09,   // FIFO_CTRL3: gyroscope in the upper half, accelerometer in the lower
  kFifoMode = 0x0A,    // FIFO_CTRL4
  kWhoAmI = 0x0F,
  kAccelerometer = 0x10,  // CTRL1: mode and rate
  kGyroscope = 0x11,      // CTRL2
  kControl = 0x12,        // CTRL3
  kGyroscopeRange = 0x15,      // CTRL6
  kAccelerometerRange = 0x17,  // CTRL8
  kFifoStatus = 0x1B,     // two bytes
  kFrequencyFine = 0x4F,  // how much faster the rates are than their names, 0.13 % a step
  kFifoTag = 0x78,        // a word: its tag and six bytes; the address goes round
};

constexpr uint8_t kAddress = 0x6A, kOtherAddress = 0x6B;  // the pin SA0 chooses
constexpr uint8_t kIdentity = 0x70;
constexpr uint8_t kReset = 0x01;             // of kControl
constexpr uint8_t kControlAsTold = 0x44;     // whole values, addresses that count up: as at power-on
constexpr uint8_t k120Hz = 0x06, k240Hz = 0x07;
constexpr uint8_t kBothRates = k240Hz << 4 | k120Hz;
constexpr uint8_t k2000DegreesS = 0x04, k8G = 0x02;
constexpr uint8_t kContinuous = 0x06;
constexpr uint8_t kOverrun = 0x48;  // in the second byte of the status: now, and since it was last read
constexpr uint8_t kWordBytes = 7;
constexpr uint8_t kGyroscopeTag = 1, kAccelerometerTag = 2;  // in the upper five bits
constexpr float kDegreesSAStep = 0.070f;
constexpr float kGAStep = 0.000244f;
constexpr float kShareAStep = 0.0013f;
constexpr uint32_t kStartUpUs = 10000;  // boot, from power-on or reset

inline int16_t value(const uint8_t* at) { return static_cast<int16_t>(at[0] | at[1] << 8); }

}  // namespace lsm6dsv
}  // namespace bunraku
