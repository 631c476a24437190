// The wearable as a whole: joins IMU, pairing, console and lamp to the ports. loop() calls step() always.
#pragma once

#include <stdint.h>

#include "battery.h"
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
  explicit Wearable(const Ports& ports) : ports_(ports), imu_(ports_.imu) {}

  void begin();  // once, at power-on: reads the flash, draws the boot nonce, starts the IMU

  // A turn of everything that is due. While linked it blocks for no longer than one bus transaction, but for
  // a flash write (some 10 ms) when a calibration or, by the console, settings are saved.
  void step();

  const Status& status() const { return status_; }

 private:
  void adopt(const Settings& settings, uint32_t now_us);
  void start_pairing();
  void stream(uint32_t now_us);
  void watch_imu(uint32_t now_us);
  void keep_calibration(uint32_t now_us);
  bool may_save_calibration(uint32_t now_us);

  void serve_cable(uint32_t now_us);
  void answer_line(const char* line, bool is_overlong, uint32_t now_us);
  const char* carry_out(Request request, uint32_t now_us);  // nullptr: done; otherwise what went wrong
  const char* keep_settings(uint32_t now_us);
  const char* forget(uint32_t now_us);
  void save_calibration(uint32_t now_us);
  bool store_profile(const uint8_t* imu_id, const uint8_t* profile);  // false: the flash did not take it
  void say_line(const char* line);

  void serve_wifi(uint32_t now_us);
  void look_for_network(uint32_t now_us);
  void join();
  void leave_network();
  void receive(const uint8_t* data, uint16_t count, const Way& from, uint32_t now_us);
  void greet(uint32_t now_us);
  bool send(const Way& to, const uint8_t* packet, uint8_t count);

  void measure_battery(uint32_t now_us);
  void light(uint32_t now_us);
  void set_lamp(bool is_on);
  void refresh_status();
  bool may_greet();
  State state() const;
  Condition condition() const;

  Ports ports_;
  Status status_;
  Settings settings_;
  Console console_;
  Pairing pairing_;
  Imu& imu_;
  Schedule schedule_;
  Battery battery_;
  Taps taps_;
  CableInput cable_input_;
  CableOutput cable_output_;

  uint32_t turn_us_ = 0;        // when the last turn began, and what is left of it below a millisecond
  uint32_t uptime_ms_ = 0, uptime_rest_us_ = 0;
  Timer battery_pause_;
  Timer strobe_;
  Timer saving_;                // the lamp warns: do not switch off
  Timer restart_pause_;         // the answer still leaves
  bool is_restarting_ = false;

  bool is_cable_connected_ = false;
  Timer cable_first_;           // the box on a new cable may take the wearable before Wi-Fi is joined
  Timer conversation_;          // someone uses the console: no hellos into it, no join that would block it

  bool is_socket_open_ = false;
  Timer join_pause_;
  bool is_radio_in_doubt_ = false;  // it may have hung the last start, and nothing has shown that it works
  Timer network_trial_;         // how long a network without a box is kept
  uint32_t trial_us_ = 0;

  bool may_greet_ = false;
  bool has_looked_for_profile_ = false;
  bool has_saved_profile_ = false;  // by itself, in this power-on
  Timer linked_lately_;
};

}  // namespace bunraku
