// The part of Wire that the sketch uses, esp32 core 3.3.3. Only signatures.
#pragma once

#include <stddef.h>
#include <stdint.h>

class TwoWire {
 public:
  bool begin();
  bool end();
  bool setClock(uint32_t hertz);
  void setTimeOut(uint16_t timeout_ms);  // limits a transaction; 50 ms at first
  void beginTransmission(uint8_t address);
  uint8_t endTransmission(bool sends_stop);  // without a stop nothing is sent before requestFrom()
  size_t requestFrom(uint8_t address, size_t quantity, bool sends_stop);
  size_t write(uint8_t data);
  size_t write(const uint8_t* data, size_t quantity);
  int read();
};
extern TwoWire Wire;
