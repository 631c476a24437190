// One turn of the wearable: stream first, then listen, then look after everything that can wait.
#include "wearable.h"

#include <string.h>

#include "boot_nonce.h"
#include "led_pattern.h"

namespace bunraku {
namespace {

constexpr uint32_t kSecondUs = 1'000'000;
constexpr uint32_t kImuStartsUs = 10'000;  // its wait for the chip begins, and passes during the first join
constexpr uint32_t kImuFirstMs = 2'000;
constexpr uint32_t kConsoleFirstUs = 10'000'000;  // after a hang: time to open the port, before the next one
constexpr uint8_t kSoundFirmware[] = {19, 5, 4};  // an older WINC1500 hangs at an empty datagram from anyone
constexpr uint32_t kUnlinkedForSavingUs = 30'000'000;  // then no dance is running: the heading may be lost

bool is_older(const uint8_t (&version)[3], const uint8_t (&other)[3]) {
  return memcmp(version, other, sizeof version) < 0;
}

// The part that fits into a packet's flags: old firmware, and the strength of the access point, 4 dB a step.
uint8_t radio_flags(const Radio& radio) {
  if (!radio.is_known()) return 0;
  const bool is_old = radio.is_winc1500 && is_older(radio.firmware, kSoundFirmware);
  const uint8_t old = is_old ? wire::kRadioIsOld : uint8_t{0};
  if (radio.rssi_dbm == 0) return old;
  int steps = (radio.rssi_dbm - wire::kWeakestDbm + 2) / wire::kDbmAStep;
  if (steps < 1) steps = 1;
  if (steps > wire::kMostSteps) steps = wire::kMostSteps;
  return static_cast<uint8_t>(old | steps << wire::kSignalShift);
}

}  // namespace

void Wearable::begin() {
  const uint32_t now_us = turn_us_ = ports_.clock.micros();
  load_settings(ports_.flash, settings_);
  status_.boot_nonce = draw_boot_nonce(settings_.key, ports_.flash, ports_.board);
  imu_.start(settings_.imu, now_us);
  start_pairing();
  is_radio_in_doubt_ = ports_.board.was_reset_by_watchdog();  // nothing else blocks this long
  join_pause_.start(now_us, is_radio_in_doubt_ ? kConsoleFirstUs : kImuStartsUs);
  schedule_.start(now_us, kSecondUs / pairing_.rate_hz());
  measure_battery(now_us);
  refresh_status();
}

void Wearable::step() {
  const uint32_t begun_us = ports_.clock.micros();
  ports_.board.feed_watchdog();
  stream(begun_us);
  watch_imu(begun_us);
  const uint32_t now_us = ports_.clock.micros();  // the bus took milliseconds; round trips count from here
  serve_cable(now_us);
  serve_wifi(now_us);
  greet(now_us);
  cable_output_.flush(ports_.serial);
  look_for_network(now_us);
  measure_battery(now_us);
  light(now_us);
  refresh_status();
  if (is_restarting_ && !restart_pause_.is_running(now_us)) ports_.board.restart();
}

void Wearable::stream(uint32_t now_us) {
  if (!schedule_.is_due(now_us)) return;
  Sample sample;
  if (!imu_.sample(now_us, sample)) return;
  status_.calibration = sample.calibration;
  uint8_t packet[wire::kLargest];
  Way to;
  const uint8_t count = pairing_.reading(sample, condition(), ports_.clock.micros(), packet, to);
  if (count > 0 && !send(to, packet, count)) ++status_.unsent;
}

void Wearable::watch_imu(uint32_t now_us) {
  imu_.step(now_us);
  int16_t linear[3];
  if (imu_.acceleration(linear) && taps_.feed(linear, now_us)) ++status_.taps;
  keep_calibration(now_us);
}

// The calibration goes flash -> IMU at power-on, and IMU -> flash -> box once it is complete.
void Wearable::keep_calibration(uint32_t now_us) {
  uint8_t offsets[kProfileBytes];
  if (!has_looked_for_profile_ && imu_.has_id()) {
    has_looked_for_profile_ = true;
    pairing_.introduce();
    if (load_profile(ports_.flash, imu_.unique_id(), offsets)) {
      imu_.use_profile(offsets);
      pairing_.announce_profile(offsets);
    }
  }
  if (may_save_calibration(now_us)) save_calibration(now_us);
  if (!imu_.profile_ready(offsets)) return;
  set_lamp(true);
  if (!store_profile(imu_.unique_id(), offsets) && conversation_.is_running(now_us))
    say_line("note: the flash did not take the calibration, it counts until power-off; try again");
  saving_.stop();
  pairing_.announce_profile(offsets);
}

// Automatically only when no heading is lost, and once: a calibration in use stays.
bool Wearable::may_save_calibration(uint32_t now_us) {
  if (pairing_.is_linked()) linked_lately_.start(now_us, kUnlinkedForSavingUs);
  if (linked_lately_.is_running(now_us) || has_saved_profile_) return false;
  has_saved_profile_ = imu_.is_running() && imu_.is_calibrated() && !imu_.has_profile();
  return has_saved_profile_;
}

void Wearable::receive(const uint8_t* data, uint16_t count, const Way& from, uint32_t now_us) {
  const uint8_t rate_hz = pairing_.rate_hz();
  const Received received = pairing_.receive(data, count, from, condition(), now_us);
  if (pairing_.rate_hz() != rate_hz) schedule_.start(schedule_.next_us(), kSecondUs / pairing_.rate_hz());
  if (received != Received::kRestore) return;
  wire::Restore restore;
  restore.read(data);
  if (imu_.use_profile(restore.offsets)) store_profile(restore.imu_id, restore.offsets);
}

bool Wearable::store_profile(const uint8_t* imu_id, const uint8_t* profile) {  // (blocks some 10 ms)
  status_.is_profile_unsaved = !save_profile(ports_.flash, imu_id, profile);
  return !status_.is_profile_unsaved;
}

// Sends what is due: hellos, and a saved calibration.
void Wearable::greet(uint32_t now_us) {
  uint8_t packet[wire::kLargest];
  Way to;
  while (const uint8_t count = pairing_.next(condition(), now_us, packet, to)) send(to, packet, count);
}

bool Wearable::send(const Way& to, const uint8_t* packet, uint8_t count) {
  if (to.lane == Lane::kWifi) {
    if (!is_socket_open_) return false;
    return to.is_broadcast ? ports_.wifi.broadcast(settings_.port, packet, count)
                           : ports_.wifi.send(to.address, packet, count);
  }
  uint8_t framed[kLongestFrame];
  return cable_output_.put(framed, frame(packet, count, framed));
}

void Wearable::measure_battery(uint32_t now_us) {
  if (battery_pause_.is_running(now_us)) return;
  battery_pause_.start(now_us, kSecondUs);
  battery_.measure(ports_.board.battery_millivolts());
}

void Wearable::light(uint32_t now_us) {
  uptime_rest_us_ += now_us - turn_us_;
  turn_us_ = now_us;
  uptime_ms_ += uptime_rest_us_ / 1000;
  uptime_rest_us_ %= 1000;
  const LightCues cues = {
      state(),           pairing_.led(),   saving_.is_running(now_us), strobe_.is_running(now_us),
      imu_.has_failed(), battery_.is_low()};
  set_lamp(is_lit(cues, uptime_ms_));
}

void Wearable::set_lamp(bool is_on) {
  if (is_on != status_.is_light_on) ports_.led.set(is_on);
  status_.is_light_on = is_on;
}

// A hello carries the IMU's id, for its kept calibration: the IMU gets a moment to report it.
bool Wearable::may_greet() {
  may_greet_ = may_greet_ || imu_.has_id() || imu_.has_failed() || uptime_ms_ > kImuFirstMs;
  return may_greet_;
}

State Wearable::state() const {
  if (!settings_.is_provisioned()) return State::kNotProvisioned;
  if (pairing_.is_linked()) return State::kLinked;
  const bool is_looking = settings_.network[0] != '\0' && !is_socket_open_ && !is_cable_connected_;
  return is_looking ? State::kJoining : State::kGreeting;
}

Condition Wearable::condition() const {
  Condition now = {};
  now.battery = battery_.percent();
  now.flags = static_cast<uint8_t>(
      (imu_.has_profile() ? wire::kHasProfile : 0) | (settings_.imu.fusion == Fusion::kNdof ? wire::kIsNdof : 0) |
      (settings_.imu.has_crystal ? wire::kHasCrystal : 0) | radio_flags(status_.radio));
  now.taps = status_.taps;
  now.recoveries = imu_.recoveries();
  if (imu_.has_id()) memcpy(now.imu_id, imu_.unique_id(), sizeof now.imu_id);
  return now;
}

void Wearable::refresh_status() {
  status_.state = state();
  status_.lane = pairing_.link().lane;
  status_.has_imu = imu_.is_running();
  status_.has_imu_id = imu_.has_id();
  if (status_.has_imu_id) memcpy(status_.imu_id, imu_.unique_id(), sizeof status_.imu_id);
  status_.has_profile = imu_.has_profile();
  status_.session = pairing_.session();
  status_.readings = pairing_.readings();
  status_.skipped = schedule_.skipped();
  status_.rate_hz = pairing_.rate_hz();
  status_.battery = battery_.percent();
  status_.battery_millivolts = battery_.millivolts();
  status_.round_trip = pairing_.round_trip();
  status_.recoveries = imu_.recoveries();
  status_.dropped = pairing_.counts();
  status_.damaged_frames = cable_input_.damaged();
}

}  // namespace bunraku
