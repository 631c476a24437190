// Which board this is, by the macro that its Arduino core defines; every other file of this folder asks here.
#pragma once

#if defined(ARDUINO_SAMD_MKR1000)
#define BUNRAKU_SAMD
#define BUNRAKU_WINC  // the radio: WiFi101
#elif defined(ARDUINO_SAMD_MKRWIFI1010)
#define BUNRAKU_SAMD
#define BUNRAKU_NINA  // the radio: WiFiNINA
#elif defined(ARDUINO_XIAO_ESP32S3) || defined(ARDUINO_NANO_ESP32)
#define BUNRAKU_ESP32
#else
#error "The wearable does not know this board. It runs on MKR1000, MKR WiFi 1010, XIAO ESP32-S3 and Nano ESP32."
#endif
