// The wearable as a whole: joins IMU, pairing, console and lamp to the ports. loop() calls step() without pause.
#pragma once

#include <stdint.h>

#include "battery.h"
#include "bno055.h"
#include "console.h"
#include "framing.h"
#include "pairing.h"
#include "ports.h"
#include "schedule.h"
#include "settings.h"
#include "status.h"
#include "taps.h"
#include "timer.h"

namespace bunraku {

class Wearable {
 public:
  explicit Wearable(const Ports& ports);

  void begin();  // once, at power-on: reads the flash, draws the boot nonce, starts the IMU
  void step();   // a turn of everything that is due; blocks only where the ports force it, and then not while linked

  const Status& status() const { return status_; }

 private:
  Ports ports_;
  Status status_;
};

}  // namespace bunraku
