// ESP-IDF 5.5's random generator. Only signatures.
#pragma once

#include <stddef.h>

extern "C" void esp_fill_random(void* buffer, size_t count);
