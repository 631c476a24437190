// The part of ESP-IDF 5.5's esp_system.h that the sketch uses. Only signatures.
#pragma once

using esp_err_t = int;
constexpr esp_err_t ESP_OK = 0;
enum esp_reset_reason_t { ESP_RST_UNKNOWN, ESP_RST_INT_WDT = 5, ESP_RST_TASK_WDT, ESP_RST_WDT };

extern "C" {
esp_reset_reason_t esp_reset_reason();
[[noreturn]] void esp_restart();
}
