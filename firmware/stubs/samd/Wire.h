// The part of Wire that the sketch uses, SAMD core 1.8.14. Only signatures.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace arduino {

class TwoWire {
 public:
  void begin();
  void end();
  void setClock(uint32_t hertz);
  void beginTransmission(uint8_t address);
  uint8_t endTransmission(bool sends_stop);
  uint8_t endTransmission();
  size_t requestFrom(uint8_t address, size_t quantity, bool sends_stop);
  size_t requestFrom(uint8_t address, size_t quantity);
  size_t write(uint8_t data);
  size_t write(const uint8_t* data, size_t quantity);
  int available();
  int read();
};

}  // namespace arduino

extern arduino::TwoWire Wire;
