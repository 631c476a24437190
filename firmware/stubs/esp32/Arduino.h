// The part of Arduino.h that the sketch uses, esp32 core 3.3.3, variants XIAO_ESP32S3 and arduino_nano_nora. Only
// signatures.
#pragma once

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define LOW 0x0
#define HIGH 0x1
#define INPUT 0x01
#define OUTPUT 0x03
#define OUTPUT_OPEN_DRAIN 0x13

#ifdef ARDUINO_XIAO_ESP32S3
static const uint8_t LED_BUILTIN = 21, SDA = 5, SCL = 6, A0 = 1;
#else
static constexpr uint8_t LED_BUILTIN = 13, SDA = 21, SCL = 22, A0 = 17;
#endif

extern "C" {
void pinMode(uint8_t pin, uint8_t mode);
void digitalWrite(uint8_t pin, uint8_t value);
int digitalRead(uint8_t pin);
uint32_t analogReadMilliVolts(uint8_t pin);
unsigned long micros();
unsigned long millis();
void delay(uint32_t milliseconds);
void delayMicroseconds(uint32_t microseconds);
}

class IPAddress {
 public:
  IPAddress();
  IPAddress(uint32_t address);
  operator uint32_t() const;
};

// HWCDC or USBCDC, by the board's USB mode; the real ones are also a Stream.
class UsbSerialOfTheCore {
 public:
  void begin(unsigned long baud = 0);
  void setTxTimeoutMs(uint32_t timeout_ms);
  int available();
  int availableForWrite();
  int read();
  size_t write(const uint8_t* buffer, size_t size);
  operator bool() const;
};
extern UsbSerialOfTheCore Serial;

class EspClass {
 public:
  uint64_t getEfuseMac();
};
extern EspClass ESP;

void setup();
void loop();
