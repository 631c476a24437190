// The I2C bus of an ESP32-S3 board over Wire.
#include "../board.h"
#ifdef BUNRAKU_ESP32

#include <Arduino.h>
#include <Wire.h>

#include "i2c_bus.h"

namespace bunraku {
namespace {

constexpr uint32_t kBusHz = 400000;
constexpr uint16_t kLongestMs = 10;  // a BNO055 stretches 22 bytes to 5 ms
constexpr uint8_t kRecoveryClocks = 9;
constexpr unsigned kHalfClockUs = 5;

// Open drain: low is driven, high is left to the pull-up.
void pull(uint8_t line, bool is_low) {
  digitalWrite(line, is_low ? LOW : HIGH);
  delayMicroseconds(kHalfClockUs);
}

}  // namespace

void Esp32Bus::begin() {
  Wire.begin();
  Wire.setClock(kBusHz);
  Wire.setTimeOut(kLongestMs);
}

bool Esp32Bus::write(uint8_t address, uint8_t reg, const uint8_t* data, uint8_t count) {
  Wire.beginTransmission(address);
  Wire.write(reg);
  Wire.write(data, count);
  return Wire.endTransmission(true) == 0;
}

bool Esp32Bus::read(uint8_t address, uint8_t reg, uint8_t* data, uint8_t count) {
  Wire.beginTransmission(address);
  Wire.write(reg);
  if (Wire.endTransmission(false) != 0) return false;
  return take(address, data, count);
}

bool Esp32Bus::receive(uint8_t address, uint8_t* data, uint8_t count) { return take(address, data, count); }

bool Esp32Bus::take(uint8_t address, uint8_t* data, uint8_t count) {
  if (Wire.requestFrom(address, size_t{count}, true) != count) return false;
  for (uint8_t i = 0; i < count; ++i) data[i] = static_cast<uint8_t>(Wire.read());
  return true;
}

void Esp32Bus::recover() {
  Wire.end();
  pinMode(SDA, OUTPUT_OPEN_DRAIN);
  pinMode(SCL, OUTPUT_OPEN_DRAIN);
  pull(SDA, false);
  for (uint8_t clock = 0; clock < kRecoveryClocks; ++clock) {
    pull(SCL, true);
    pull(SCL, false);
  }
  pull(SCL, true);  // a stop: data rises while the clock is high
  pull(SDA, true);
  pull(SCL, false);
  pull(SDA, false);
  begin();
}

}  // namespace bunraku

#endif
