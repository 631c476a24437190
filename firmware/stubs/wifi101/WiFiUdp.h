// The part of the UDP socket of WiFi101 0.16.1 that the sketch uses. Only signatures.
#pragma once

#include <Arduino.h>

class WiFiUDP {
 public:
  WiFiUDP();
  virtual uint8_t begin(uint16_t port);
  virtual void stop();
  virtual int beginPacket(IPAddress ip, uint16_t port);
  virtual int endPacket();
  virtual size_t write(uint8_t byte);
  virtual size_t write(const uint8_t* buffer, size_t size);
  virtual int parsePacket();
  virtual int read();
  virtual int read(unsigned char* buffer, size_t length);
  virtual IPAddress remoteIP();
  virtual uint16_t remotePort();
};
