// The I2C bus of an MKR board over Wire. Wire itself waits without end for a line that never rises, so: no
// transaction starts while a line is held, the SERCOM gives up on a clock held for 25 ms (its SMBus time-out),
// and what is left after that the watchdog ends.
#include "../board.h"
#ifdef BUNRAKU_SAMD

#include "wire_bus.h"

#include <Wire.h>

namespace bunraku {
namespace {

constexpr uint32_t kBusHz = 400000;     // the chips' fastest; a BNO055 stretches the clock as it needs
constexpr uint8_t kRecoveryClocks = 9;  // a byte and its acknowledge: whatever a slave was saying, it ends
constexpr unsigned kHalfClockUs = 5;
constexpr unsigned kStretchUs = 1000;  // the longest that a released clock is waited for

// limit_waits() sets registers of the board's SERCOM for Wire: of another one it would break what hangs there,
// on the MKR1000 the Wi-Fi module (SERCOM2).
constexpr bool is_same(const SERCOM& one, const SERCOM& other) { return &one == &other; }
static_assert(is_same(PERIPH_WIRE, sercom0), "on this board Wire is not on SERCOM0: set limit_waits() to its own");

}  // namespace

void WireBus::begin() {
  pinMode(PIN_WIRE_SDA, INPUT);  // leaves the input buffers on, so the lines can be read beside the SERCOM
  pinMode(PIN_WIRE_SCL, INPUT);
  Wire.begin();
  Wire.setClock(kBusHz);
  limit_waits();
}

bool WireBus::write(uint8_t address, uint8_t reg, const uint8_t* data, uint8_t count) {
  if (!is_free()) return false;
  Wire.beginTransmission(address);
  Wire.write(reg);
  Wire.write(data, count);
  return Wire.endTransmission(true) == 0;
}

// A single register is read with its neighbour: for a single byte, Wire 1.8.14 decides by an unset variable
// whether to send the stop.
bool WireBus::read(uint8_t address, uint8_t reg, uint8_t* data, uint8_t count) {
  if (!is_free()) return false;
  Wire.beginTransmission(address);
  Wire.write(reg);
  if (Wire.endTransmission(false) != 0) return false;
  const size_t asked = count < 2 ? 2 : count;
  if (Wire.requestFrom(address, asked, true) != asked) return false;
  for (uint8_t i = 0; i < count; ++i) data[i] = static_cast<uint8_t>(Wire.read());
  return true;
}

bool WireBus::receive(uint8_t address, uint8_t* data, uint8_t count) {
  if (count < 2 || !is_free()) return false;
  if (Wire.requestFrom(address, size_t{count}, true) != count) return false;
  for (uint8_t i = 0; i < count; ++i) data[i] = static_cast<uint8_t>(Wire.read());
  return true;
}

void WireBus::recover() {
  Wire.end();
  pull(PIN_WIRE_SDA, false);
  for (uint8_t clock = 0; clock < kRecoveryClocks; ++clock) {
    pull(PIN_WIRE_SCL, true);
    pull(PIN_WIRE_SCL, false);
  }
  pull(PIN_WIRE_SCL, true);  // a stop: data rises while the clock is high
  pull(PIN_WIRE_SDA, true);
  pull(PIN_WIRE_SCL, false);
  pull(PIN_WIRE_SDA, false);
  begin();
}

// Wire returns before its stop is on the bus, and the chip may stretch that too: a moment is granted.
bool WireBus::is_free() {
  for (unsigned waited = 0; waited < kStretchUs; waited += kHalfClockUs) {
    if (digitalRead(PIN_WIRE_SDA) == HIGH && digitalRead(PIN_WIRE_SCL) == HIGH) return true;
    delayMicroseconds(kHalfClockUs);
  }
  return false;
}

// SAM D21 data sheet, SERCOM I2C CTRLA: LOWTOUTEN ends a transaction with the clock low for 25 to 35 ms.
// It counts by the SERCOMs' slow clock, which the core leaves without a source: here the 32 kHz crystal, which
// the core has put on generator 1. INACTOUT stays off: its 200 us are less than the BNO055 stretches.
void WireBus::limit_waits() {
  GCLK->CLKCTRL.reg =
      static_cast<uint16_t>(GCLK_CLKCTRL_ID_SERCOMX_SLOW | GCLK_CLKCTRL_GEN_GCLK1 | GCLK_CLKCTRL_CLKEN);
  while (GCLK->STATUS.reg & GCLK_STATUS_SYNCBUSY) {
  }
  auto& i2c = SERCOM0->I2CM;
  i2c.CTRLA.reg &= ~SERCOM_I2CM_CTRLA_ENABLE;  // the field is locked while enabled
  while (i2c.SYNCBUSY.reg & SERCOM_I2CM_SYNCBUSY_ENABLE) {
  }
  i2c.CTRLA.reg |= SERCOM_I2CM_CTRLA_LOWTOUTEN;
  i2c.CTRLA.reg |= SERCOM_I2CM_CTRLA_ENABLE;
  while (i2c.SYNCBUSY.reg & SERCOM_I2CM_SYNCBUSY_ENABLE) {
  }
  i2c.STATUS.reg = SERCOM_I2CM_STATUS_BUSSTATE(1);  // idle
  while (i2c.SYNCBUSY.reg & SERCOM_I2CM_SYNCBUSY_SYSOP) {
  }
}

// Open drain by hand: low is driven, high is left to the pull-up and to clock stretching.
void WireBus::pull(pin_size_t line, bool is_low) {
  pinMode(line, INPUT);
  if (is_low) {
    digitalWrite(line, LOW);
    pinMode(line, OUTPUT);
    delayMicroseconds(kHalfClockUs);
    return;
  }
  for (unsigned waited = 0; digitalRead(line) == LOW && waited < kStretchUs; waited += kHalfClockUs) {
    delayMicroseconds(kHalfClockUs);
  }
  delayMicroseconds(kHalfClockUs);
}

}  // namespace bunraku

#endif
