// The rest of an MKR board: lamp, battery, watchdog, noise.
#include "../board.h"
#ifdef BUNRAKU_SAMD

#include "mkr_board.h"

#include <Arduino.h>

namespace bunraku {
namespace {

#ifdef BUNRAKU_NINA
// The MKR WiFi 1010 has its divider on board, 330 kilohm and 1 megohm: 4.39 V are the full 3.3 V at the pin.
constexpr uint8_t kBatteryPin = ADC_BATTERY;
constexpr uint32_t kFullScaleMillivolts = 4389;
#else
// The MKR1000 does not measure its battery. Two resistors do: battery + to A1 over 100 kilohm, A1 to ground
// over 330 kilohm; 4.3 V at the battery is the full 3.3 V at the pin.
constexpr uint8_t kBatteryPin = A1;
constexpr uint32_t kFullScaleMillivolts = 4300;
#endif
constexpr uint16_t kLeastMillivolts = 2500;  // below it nothing runs: the resistors or the cell are not there
constexpr uint8_t kNoisePin = A3;            // open
constexpr uint8_t kAdcBits = 12;
constexpr uint8_t kSamplesPerByte = 8;  // 0.8 ms each
constexpr uint8_t kWatchdogClock = 2;   // the generic clock generator that is free for it
constexpr uint8_t kWatchdogClient = 3;  // SAM D21 data sheet, table of GCLK clients

}  // namespace

void BuiltinLed::begin() { pinMode(LED_BUILTIN, OUTPUT); }

void BuiltinLed::set(bool is_on) { digitalWrite(LED_BUILTIN, is_on ? HIGH : LOW); }

void MkrBoard::begin() {
  analogReadResolution(kAdcBits);
  start_watchdog();
}

// The pin is emptied first, so that without the resistors it reads nothing instead of what it last held.
uint16_t MkrBoard::battery_millivolts() {
  pinMode(kBatteryPin, OUTPUT);
  digitalWrite(kBatteryPin, LOW);
  delayMicroseconds(20);
  pinMode(kBatteryPin, INPUT);
  delayMicroseconds(200);
  const uint32_t raw = static_cast<uint32_t>(analogRead(kBatteryPin));
  const uint32_t millivolts = raw * kFullScaleMillivolts / ((1u << kAdcBits) - 1);
  return millivolts < kLeastMillivolts ? 0 : static_cast<uint16_t>(millivolts);
}

// The SAM D21 has no random number generator: what is left is the noise of the converter on an open pin and the
// phase of the system timer. The boot counter makes a nonce new even where this repeats.
void MkrBoard::noise(uint8_t* data, uint8_t count) {
  for (uint8_t i = 0; i < count; ++i) {
    uint32_t mixed = SysTick->VAL;
    for (uint8_t sample = 0; sample < kSamplesPerByte; ++sample) {
      mixed = mixed << 5 ^ mixed >> 3 ^ static_cast<uint32_t>(analogRead(kNoisePin)) ^ SysTick->VAL << 12;
    }
    data[i] = static_cast<uint8_t>(mixed ^ mixed >> 8 ^ mixed >> 16 ^ mixed >> 24);
  }
}

void MkrBoard::feed_watchdog() {
  if (WDT->STATUS.reg & WDT_STATUS_SYNCBUSY) return;  // the last feeding is still on its way
  WDT->CLEAR.reg = WDT_CLEAR_CLEAR_KEY;
}

void MkrBoard::restart() { NVIC_SystemReset(); }

bool MkrBoard::was_reset_by_watchdog() { return (PM->RCAUSE.reg & PM_RCAUSE_WDT) != 0; }

// SAM D21 data sheet, "Serial Number": 128 bits in four words, folded into one.
uint32_t MkrBoard::serial_number() {
  uint32_t folded = 0;
  constexpr uintptr_t kWords[] = {0x0080A00C, 0x0080A040, 0x0080A044, 0x0080A048};
  for (const uintptr_t address : kWords) {
    folded ^= *reinterpret_cast<const volatile uint32_t*>(address);
  }
  return folded;
}

// 16 s, longer than the longest call that may block (joining Wi-Fi, 10 s): 16384 ticks of 1024 Hz, which are the
// 32 kHz oscillator divided by 2^(4+1).
void MkrBoard::start_watchdog() {
  GCLK->GENDIV.reg = GCLK_GENDIV_ID(kWatchdogClock) | GCLK_GENDIV_DIV(4);
  while (GCLK->STATUS.reg & GCLK_STATUS_SYNCBUSY) {
  }
  GCLK->GENCTRL.reg =
      GCLK_GENCTRL_ID(kWatchdogClock) | GCLK_GENCTRL_GENEN | GCLK_GENCTRL_SRC_OSCULP32K | GCLK_GENCTRL_DIVSEL;
  while (GCLK->STATUS.reg & GCLK_STATUS_SYNCBUSY) {
  }
  GCLK->CLKCTRL.reg = static_cast<uint16_t>(GCLK_CLKCTRL_ID(kWatchdogClient) | GCLK_CLKCTRL_CLKEN |
                                            GCLK_CLKCTRL_GEN(kWatchdogClock));
  while (GCLK->STATUS.reg & GCLK_STATUS_SYNCBUSY) {
  }
  WDT->CTRL.reg = 0;
  while (WDT->STATUS.reg & WDT_STATUS_SYNCBUSY) {
  }
  WDT->CONFIG.reg = WDT_CONFIG_PER_16K;
  WDT->CTRL.reg = WDT_CTRL_ENABLE;
  while (WDT->STATUS.reg & WDT_STATUS_SYNCBUSY) {
  }
}

}  // namespace bunraku

#endif
