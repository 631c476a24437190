// The part of WiFiNINA 1.9.1 that the sketch uses. Only signatures.
#pragma once

#include <Arduino.h>

enum wl_status_t { WL_NO_SHIELD = 255, WL_IDLE_STATUS = 0, WL_CONNECTED = 3, WL_DISCONNECTED = 6 };

class WiFiClass {
 public:
  int begin(const char* ssid);
  int begin(const char* ssid, const char* passphrase);
  int disconnect();
  void end();
  IPAddress localIP();
  IPAddress subnetMask();
  uint8_t status();
  static const char* firmwareVersion();
  int32_t RSSI();
  void noLowPowerMode();
  void setTimeout(
      unsigned long timeout_ms);  // limits begin(), which looks every five seconds; 0: it returns at once
};
extern WiFiClass WiFi;
