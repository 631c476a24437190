// The part of WiFi101 0.16.1 that the sketch uses. Only signatures.
#pragma once

#include <Arduino.h>

enum wl_status_t {
  WL_NO_SHIELD = 255,
  WL_IDLE_STATUS = 0,
  WL_NO_SSID_AVAIL,
  WL_SCAN_COMPLETED,
  WL_CONNECTED,
  WL_CONNECT_FAILED,
  WL_CONNECTION_LOST,
  WL_DISCONNECTED,
};

class WiFiClass {
 public:
  uint8_t begin(const char* ssid);
  uint8_t begin(const char* ssid, const char* key);
  void disconnect();
  void end();
  uint32_t localIP();
  uint32_t subnetMask();
  uint8_t status();
  char* firmwareVersion();
  int32_t RSSI();  // signal of the joined network, dBm; waits for the module, up to 1 s
  void noLowPowerMode();
  void setTimeout(unsigned long timeout_ms);
};

extern WiFiClass WiFi;
