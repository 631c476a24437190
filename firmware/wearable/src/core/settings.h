// A wearable's memory over power-off: settings, a calibration profile, how often it was switched on.
#pragma once

#include <stdint.h>

#include "ports.h"
#include "wire.h"

namespace bunraku {

constexpr uint8_t kLongestName = 24, kLongestNetwork = 32, kLongestPassword = 63;
constexpr uint16_t kDefaultPort = 9750;  // port of the box, UDP

struct Settings {
  char name[kLongestName + 1] = "";
  uint32_t device_id = 0;  // 0: none
  bool has_key = false;
  uint8_t key[wire::kKeyBytes] = {};
  char network[kLongestNetwork + 1] = "";  // empty: only the cable
  char password[kLongestPassword + 1] = "";
  uint16_t port = kDefaultPort;
  ImuSettings imu = {Fusion::kImuPlus, 0x24, 0x00};

  bool is_provisioned() const { return device_id != 0 && has_key; }
};

// False, and the defaults stand: never written, damaged, or of another firmware's layout.
bool load_settings(FlashStore& flash, Settings& settings);
bool save_settings(FlashStore& flash, const Settings& settings);

// False: there is none, or it belongs to another IMU.
bool load_profile(FlashStore& flash, const uint8_t* imu_id, uint8_t* offsets);
bool save_profile(FlashStore& flash, const uint8_t* imu_id, const uint8_t* offsets);

bool forget_all(FlashStore& flash);  // settings and profile; power-ons stay counted

// Counts this power-on and returns its number. Two records take turns, so that a power cut loses no count.
uint32_t count_boot(FlashStore& flash);

}  // namespace bunraku
