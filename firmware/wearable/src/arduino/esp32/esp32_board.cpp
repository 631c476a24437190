// The rest of an ESP32-S3 board: lamp, battery, watchdog, noise.
#include "../board.h"
#ifdef BUNRAKU_ESP32

#include <Arduino.h>
#include <bootloader_random.h>
#include <esp_random.h>
#include <esp_system.h>
#include <esp_task_wdt.h>

#include "esp32_board.h"

namespace bunraku {
namespace {

// Neither board measures its cell. Two equal resistors (220 kilohm) do: battery + to A0, A0 to ground.
constexpr uint8_t kBatteryPin = A0;
constexpr uint32_t kDivider = 2;
constexpr uint32_t kLeastMillivolts = 2500;  // below it nothing runs: the resistors are not there
constexpr uint32_t kWatchdogMs = 16000;      // longer than the longest call that may block (joining, 10 s)

#ifdef ARDUINO_XIAO_ESP32S3
constexpr bool kIsLampInverted = true;  // it hangs between the supply and its pin
#else
constexpr bool kIsLampInverted = false;
#endif

}  // namespace

void Esp32Lamp::begin() {
  pinMode(LED_BUILTIN, OUTPUT);
  set(false);
}

void Esp32Lamp::set(bool is_on) { digitalWrite(LED_BUILTIN, is_on != kIsLampInverted ? HIGH : LOW); }

// The Arduino core starts the watchdog for its idle tasks, with another time-out; here it watches only the loop.
void Esp32Board::begin() {
  esp_task_wdt_config_t config = {};
  config.timeout_ms = kWatchdogMs;
  config.trigger_panic = true;
  if (esp_task_wdt_reconfigure(&config) != ESP_OK) esp_task_wdt_init(&config);
  esp_task_wdt_add(nullptr);
}

// The pin is emptied first, so that without the resistors it reads nothing instead of what it last held.
uint16_t Esp32Board::battery_millivolts() {
  pinMode(kBatteryPin, OUTPUT);
  digitalWrite(kBatteryPin, LOW);
  delayMicroseconds(20);
  pinMode(kBatteryPin, INPUT);
  delayMicroseconds(200);
  const uint32_t millivolts = analogReadMilliVolts(kBatteryPin) * kDivider;
  return millivolts < kLeastMillivolts ? 0 : static_cast<uint16_t>(millivolts);
}

// Called once, before Wi-Fi runs: without the radio only this source makes the generator's noise true.
void Esp32Board::noise(uint8_t* data, uint8_t count) {
  bootloader_random_enable();
  esp_fill_random(data, count);
  bootloader_random_disable();
}

void Esp32Board::feed_watchdog() { esp_task_wdt_reset(); }

void Esp32Board::restart() { esp_restart(); }

bool Esp32Board::was_reset_by_watchdog() {
  const esp_reset_reason_t reason = esp_reset_reason();
  return reason == ESP_RST_TASK_WDT || reason == ESP_RST_INT_WDT || reason == ESP_RST_WDT;
}

// The address that its fuses hold, folded.
uint32_t Esp32Board::serial_number() {
  const uint64_t address = ESP.getEfuseMac();
  return static_cast<uint32_t>(address) ^ static_cast<uint32_t>(address >> 32);
}

}  // namespace bunraku

#endif
