// The part of Arduino.h that the sketch uses, SAMD core 1.8.14 with API 1.5, variants mkr1000 and
// mkrwifi1010. Only signatures.
#pragma once

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "samd21.h"

namespace arduino {

enum PinStatus { LOW = 0, HIGH = 1, CHANGE = 2, FALLING = 3, RISING = 4 };
enum PinMode { INPUT = 0, OUTPUT = 1, INPUT_PULLUP = 2, INPUT_PULLDOWN = 3, OUTPUT_OPENDRAIN = 4 };
using pin_size_t = uint8_t;

class IPAddress {
 public:
  IPAddress();
  IPAddress(uint8_t first_octet, uint8_t second_octet, uint8_t third_octet, uint8_t fourth_octet);
  IPAddress(uint32_t address);
  operator uint32_t() const;
};

}  // namespace arduino

using namespace arduino;

constexpr pin_size_t PIN_WIRE_SDA = 11, PIN_WIRE_SCL = 12, LED_BUILTIN = 6;
class SERCOM;
extern SERCOM sercom0, sercom2;
#define PERIPH_WIRE sercom0

static const uint8_t A1 = 16, A3 = 18;
#ifdef ARDUINO_SAMD_MKRWIFI1010
static const uint8_t ADC_BATTERY = 32;
#endif

extern "C" {
void pinMode(pin_size_t pin, PinMode mode);
void digitalWrite(pin_size_t pin, PinStatus value);
PinStatus digitalRead(pin_size_t pin);
int analogRead(pin_size_t pin);
void analogReadResolution(int bits);
unsigned long micros();
unsigned long millis();
void delay(unsigned long milliseconds);
void delayMicroseconds(unsigned int microseconds);
}

// USB serial; the real one is also a Print and a Stream.
class Serial_ {
 public:
  void begin(unsigned long baudrate);
  void end();
  int available();
  int availableForWrite();  // always 63
  int read();
  size_t write(uint8_t byte);
  size_t write(const uint8_t* buffer, size_t size);  // waits up to 70 ms
  operator bool();  // waits 10 ms
  bool dtr();
};
extern Serial_ SerialUSB;
#define Serial SerialUSB

class USBDeviceClass {
 public:
  bool configured();
};
extern USBDeviceClass USBDevice;

void setup();
void loop();
