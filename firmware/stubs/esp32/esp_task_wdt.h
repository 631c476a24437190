// The part of ESP-IDF 5.5's task watchdog that the sketch uses. Only signatures.
#pragma once

#include <stdint.h>

#include "esp_system.h"

struct esp_task_wdt_config_t {
  uint32_t timeout_ms;
  uint32_t idle_core_mask;  // whose idle tasks are watched
  bool trigger_panic;       // and with it a restart
};
struct tskTaskControlBlock;
using TaskHandle_t = tskTaskControlBlock*;

extern "C" {
esp_err_t esp_task_wdt_init(const esp_task_wdt_config_t* config);
esp_err_t esp_task_wdt_reconfigure(const esp_task_wdt_config_t* config);
esp_err_t esp_task_wdt_add(TaskHandle_t task);  // null: this one
esp_err_t esp_task_wdt_reset();
}
