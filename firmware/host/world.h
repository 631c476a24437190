// One simulated wearable: the firmware on a model of its board, on a hand, near an access point.
#pragma once

#include <memory>

#include "any_imu.h"
#include "board_model.h"
#include "flash_model.h"
#include "imu_model.h"
#include "path.h"
#include "serial_model.h"
#include "virtual_clock.h"
#include "wearable.h"
#include "wifi_model.h"

namespace bunraku {

struct WorldCounts {
  uint32_t power_ons = 0;
  uint32_t restarts = 0;         // asked for by the firmware
  uint32_t watchdog_bites = 0;   // restarts because it hung: never right
  uint64_t longest_linked_step_us = 0;  // the longest turn of the loop that began and ended linked
};

// Which chip is wired. The firmware of the MKR boards drives a BNO055; that of the ESP32 boards searches for its chip.
enum class Wired : uint8_t { kBno055, kBno085, kLsm6dsv };

class World {
 public:
  World(uint64_t seed, uint64_t start_us, Wired wired = Wired::kBno055);

  void power(bool is_on);        // the switch: only the flash is kept
  void step_until(uint64_t us);  // runs on; a call that blocks may end later than asked for
  bool is_on() const { return wearable_ != nullptr; }
  Status status() const;  // at the time that was asked for, also when a call blocks beyond it; while on
  uint64_t booted_at_us() const { return booted_at_us_; }       // when the board's clock showed first_micros

  VirtualClock clock;
  BoardClock board_clock{clock};
  WifiModel wifi;
  SerialModel serial;
  FlashModel flash{clock};
  LedTrace led{clock};
  BoardModel board;
  std::unique_ptr<ImuModel> chip;
  ImuModel& imu;
  Path hand;  // orientation of the chip in a world with z up
  uint64_t first_micros = 0;  // what the board's clock shows at each power-on
  WorldCounts counts;

 private:
  void boot();
  void forget_what_was_ahead();
  void turn();

  Wired wired_;
  Random loop_;
  uint64_t until_us_;
  Status before_;  // the turn that is over, or that blocks
  uint64_t booted_at_us_ = 0;
  std::unique_ptr<Bno055> bno055_;
  std::unique_ptr<AnyImu> any_imu_;
  std::unique_ptr<Wearable> wearable_;
};

}  // namespace bunraku
