// The part of WiFi that the sketch uses, esp32 core 3.3.3. Only signatures.
#pragma once

#include <Arduino.h>

enum wl_status_t { WL_IDLE_STATUS = 0, WL_CONNECTED = 3, WL_DISCONNECTED = 6 };
enum wifi_mode_t { WIFI_MODE_NULL = 0, WIFI_MODE_STA };
#define WIFI_STA WIFI_MODE_STA

class WiFiClass {
 public:
  bool mode(wifi_mode_t mode);
  void persistent(bool is_kept_in_flash);
  bool setAutoReconnect(bool is_automatic);
  bool setSleep(bool is_saving_power);
  wl_status_t begin(const char* ssid, const char* passphrase = nullptr, int32_t channel = 0,
                    const uint8_t* bssid = nullptr, bool connects = true);
  bool disconnect(bool switches_off = false, bool erases_access_point = false, unsigned long timeout_ms = 0);
  static wl_status_t status();
  IPAddress broadcastIP() const;
  int8_t RSSI();
};
extern WiFiClass WiFi;
