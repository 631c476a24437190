// A wearable's own report at any moment: for the console, the simulation and the tests.
#pragma once

#include <stdint.h>

#include "pairing.h"
#include "ports.h"

namespace bunraku {

enum class State : uint8_t {
  kNotProvisioned,  // has no device id or no key: waits for the cable
  kJoining,         // looks for its Wi-Fi network
  kGreeting,        // at least one lane is up; sends hellos and waits for an assignment
  kLinked,          // streams to its box
};

struct Status {
  State state = State::kNotProvisioned;
  Lane lane = Lane::kNone;  // the link's
  bool has_imu = false;     // fusion runs and gives data
  bool has_imu_id = false;
  bool has_profile = false;
  bool is_profile_unsaved = false;  // in use, but the flash did not take it
  bool is_light_on = false;
  Radio radio;              // at the last join
  uint8_t imu_id[16] = {};
  uint32_t boot_nonce = 0;
  uint32_t session = 0;
  uint32_t readings = 0;         // sent since power-on
  uint32_t skipped = 0;          // slots of the grid that a stall has cost
  uint32_t unsent = 0;           // readings that the driver did not take
  uint8_t rate_hz = 0;
  uint8_t battery = 0;           // percent; 255 unknown
  uint16_t battery_millivolts = 0;
  uint16_t round_trip = 0;       // 0.1 ms; 65535 unknown
  uint8_t calibration = 0;       // of the newest sample, as in Sample
  uint8_t taps = 0;
  uint8_t recoveries = 0;        // as told to the box: restarts of the IMU and whatever else cost the heading
  PairingCounts dropped;
  uint32_t damaged_frames = 0;   // on the cable
  uint16_t joins = 0;            // attempts to join the Wi-Fi network
};

}  // namespace bunraku
