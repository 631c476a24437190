// The part of Preferences that the sketch uses, esp32 core 3.3.3. Only signatures.
#pragma once

#include <Arduino.h>

class Preferences {
 public:
  bool begin(const char* name, bool is_read_only = false, const char* partition = nullptr);
  bool isKey(const char* key);
  size_t putBytes(const char* key, const void* value, size_t count);
  size_t getBytesLength(const char* key);
  size_t getBytes(const char* key, void* buffer, size_t room);
};
