// The console on the cable: provisioning for `bunraku provision`, status for people. A line in, a line out.
//
//   id                      ok bunraku-wearable 1.0.0 wire 2d20a5df imu <32 hex|none> board <8 hex>
//   set device <8 hex>      ok            ... name <word>, key <32 hex>, network <rest of line>,
//   set password <rest>     ok                port <n>, fusion imuplus|ndof, crystal yes|no, axes <2 hex> <2 hex>
//   save                    ok saved      what was set counts from now on, and after power-off
//   show                    ok name <word|none> device <8 hex|none> key set|none password set|none port <n>
//                           fusion imuplus|ndof crystal yes|no axes <2 hex> <2 hex>
//                           network <rest of line, may be empty>
//   forget                  ok forgotten
//   prove <16 hex>          ok <16 hex>   BLAKE2s-8 with the key over b"prove" and the 8 bytes
//   status                  ok state <linked|greeting|joining|unprovisioned> way <wifi|cable|none> ...
//                           radio <version of its firmware> <-n> dBm|unknown ...
//   strobe                  ok
//   calibration save        ok saving ...
//   help                    ok <commands>
//   restart                 ok restarting
//
// Errors are answered with `error: what, what to do`. A key or a password never leaves by the console.
#pragma once

#include <stdint.h>

#include "answer.h"
#include "settings.h"
#include "status.h"

namespace bunraku {

// Requests that the console passes on to the wearable, which reports failures.
enum class Request : uint8_t { kNothing, kSave, kForget, kStrobe, kSaveCalibration, kRestart };

class Console {
 public:
  // The settings that are in force; what `set` changes stays a draft until `save`.
  void begin(const Settings& settings) { draft_ = settings; }
  const Settings& draft() const { return draft_; }

  Request execute(const char* line, const Status& status, uint32_t board_number, Answer& answer);

 private:
  Request request(const char* line, Answer& answer) const;
  void show(Answer& answer) const;
  void prove(const char* nonce, Answer& answer) const;

  Settings draft_;
};

}  // namespace bunraku
