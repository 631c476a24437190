// The wearable's two lanes: the cable with its console, and Wi-Fi with what blocks there.
#include "wearable.h"

#include <string.h>

#include "saturating.h"

namespace bunraku {
namespace {

constexpr uint16_t kOwnPort = 2390;  // UDP, of the wearable
constexpr uint8_t kDatagramsATurn = 4;  // a stranger's flood costs 0.4 ms each for its tag, no more
constexpr uint8_t kBytesATurn = 64;
constexpr uint32_t kCableFirstUs = 1'000'000;
constexpr uint32_t kConversationUs = 3'000'000, kConversationAfterSaveUs = 1'000'000;
constexpr uint32_t kJoinPauseUs = 1'000'000, kJoinPauseWithCableUs = 3'000'000;
constexpr uint32_t kTrialUs = 10'000'000, kLongestTrialUs = 40'000'000;
constexpr uint32_t kRestartPauseUs = 100'000;
constexpr uint32_t kStrobeUs = 10'000'000;
constexpr uint32_t kSavingUs = 2'000'000;
constexpr char kLineEnd[] = "\r\n";
constexpr uint8_t kLineEndBytes = sizeof kLineEnd - 1;
constexpr uint16_t kLongestAnswer = Answer::kRoom + kLineEndBytes;

}  // namespace

void Wearable::serve_cable(uint32_t now_us) {
  const bool is_connected = ports_.serial.is_connected();
  if (is_connected != is_cable_connected_) {
    is_cable_connected_ = is_connected;
    cable_input_.reset();
    cable_output_.reset();
    console_.begin(settings_);  // what was set and not saved is forgotten with the cable
    conversation_.stop();
    cable_first_.start(now_us, kCableFirstUs);
  }
  // Hellos would disturb typing; a link on the cable continues.
  const bool is_quiet = conversation_.is_running(now_us) && pairing_.link().lane != Lane::kCable;
  pairing_.set_lane(Lane::kCable, is_connected && !is_quiet && may_greet());
  uint8_t byte;
  for (uint8_t i = 0; i < kBytesATurn && cable_output_.has_room(kLongestAnswer); ++i) {
    if (ports_.serial.read(&byte, 1) == 0) break;
    const CableInput::Found found = cable_input_.feed(byte, now_us);
    if (found == CableInput::Found::kPacket)
      receive(cable_input_.packet(), cable_input_.packet_bytes(), {Lane::kCable, false, {0, 0}}, now_us);
    else if (found != CableInput::Found::kNothing)
      answer_line(cable_input_.line(), found == CableInput::Found::kOverlongLine, now_us);
  }
}

void Wearable::answer_line(const char* line, bool is_overlong, uint32_t now_us) {
  conversation_.start(now_us, kConversationUs);
  Answer answer;
  if (is_overlong) {
    answer.add("error: a line has 128 bytes at most, nothing was done; type help");
  } else {
    const Request request = console_.execute(line, status_, ports_.board.serial_number(), answer);
    const char* fault = carry_out(request, now_us);
    if (fault != nullptr) {
      answer.clear();
      answer.add("error: ").add(fault);
    }
  }
  say_line(answer.text());
}

void Wearable::say_line(const char* line) {
  cable_output_.put(reinterpret_cast<const uint8_t*>(line), static_cast<uint16_t>(strlen(line)));
  cable_output_.put(reinterpret_cast<const uint8_t*>(kLineEnd), kLineEndBytes);
}

const char* Wearable::carry_out(Request request, uint32_t now_us) {
  switch (request) {
    case Request::kSave: return keep_settings(now_us);
    case Request::kForget: return forget(now_us);
    case Request::kStrobe: strobe_.start(now_us, kStrobeUs); return nullptr;
    case Request::kSaveCalibration:
      if (!imu_.is_running()) return "no running IMU, nothing was saved; check its wiring";
      if (!imu_.is_calibrated()) return "not calibrated yet, nothing was saved; turn it slowly through six poses";
      save_calibration(now_us);
      return nullptr;
    case Request::kRestart:
      is_restarting_ = true;
      restart_pause_.start(now_us, kRestartPauseUs);
      return nullptr;
    default: return nullptr;
  }
}

const char* Wearable::keep_settings(uint32_t now_us) {
  set_lamp(true);
  if (!save_settings(ports_.flash, console_.draft()))  // (blocks some 10 ms)
    return "the flash did not take the settings, the old ones count until power-off; try again";
  adopt(console_.draft(), now_us);
  return nullptr;
}

const char* Wearable::forget(uint32_t now_us) {
  set_lamp(true);
  if (!forget_all(ports_.flash)) return "the flash did not take it, not all is forgotten; try again";
  adopt(Settings(), now_us);
  return nullptr;
}

void Wearable::save_calibration(uint32_t now_us) {
  imu_.save_profile();
  saving_.start(now_us, kSavingUs);
}

// Apply settings: restarts pairing, and Wi-Fi and IMU if their settings changed.
void Wearable::adopt(const Settings& settings, uint32_t now_us) {
  const bool is_same_network =
      strcmp(settings.network, settings_.network) == 0 && strcmp(settings.password, settings_.password) == 0;
  const ImuSettings& imu = settings.imu;
  const bool is_same_imu = imu.fusion == settings_.imu.fusion && imu.axis_map == settings_.imu.axis_map &&
                           imu.axis_sign == settings_.imu.axis_sign &&
                           imu.has_crystal == settings_.imu.has_crystal;
  settings_ = settings;
  if (is_socket_open_ && !is_same_network) leave_network();
  start_pairing();
  conversation_.start(now_us, kConversationAfterSaveUs);
  if (is_same_imu) return;
  imu_.start(settings_.imu, now_us);
  has_looked_for_profile_ = false;
}

void Wearable::start_pairing() {
  console_.begin(settings_);
  pairing_.begin(settings_.is_provisioned() ? settings_.device_id : 0, settings_.key, status_.boot_nonce);
  trial_us_ = kTrialUs;
}

void Wearable::serve_wifi(uint32_t now_us) {
  if (is_socket_open_ && !ports_.wifi.is_up()) is_socket_open_ = false;  // a disconnect has closed it
  pairing_.set_lane(Lane::kWifi, is_socket_open_ && may_greet());
  uint8_t data[wire::kLargest];
  Way from;
  from.lane = Lane::kWifi;
  for (uint8_t i = 0; i < kDatagramsATurn && is_socket_open_; ++i) {
    const uint16_t count = ports_.wifi.receive(data, sizeof data, from.address);
    if (count == 0) break;
    receive(data, count, from, now_us);
  }
}

// Never while linked, on whatever lane: joining blocks.
void Wearable::look_for_network(uint32_t now_us) {
  const bool is_cable_first = cable_first_.is_running(now_us);
  const bool is_pausing = join_pause_.is_running(now_us);
  if (pairing_.is_linked()) {
    trial_us_ = kTrialUs;
    network_trial_.start(now_us, trial_us_);
    return;
  }
  if (!settings_.is_provisioned() || settings_.network[0] == '\0') return;
  if (is_socket_open_ && network_trial_.is_running(now_us)) return;
  if (is_cable_first || is_pausing || conversation_.is_running(now_us)) return;
  if (is_radio_in_doubt_ && is_cable_connected_) return;  // it could hang again, and the console with it
  if (is_socket_open_) {
    leave_network();  // joined by the driver's word, but no box: it may be wrong
    trial_us_ = trial_us_ < kLongestTrialUs ? 2 * trial_us_ : kLongestTrialUs;
  }
  join();
}

void Wearable::join() {
  count(status_.joins);
  set_lamp(true);  // nothing can make it blink meanwhile
  const bool is_joined = ports_.wifi.join(settings_.network, settings_.password);  // (blocks, up to 10 s)
  ports_.board.feed_watchdog();
  is_radio_in_doubt_ = false;
  if (is_joined) status_.radio = ports_.wifi.radio();
  is_socket_open_ = is_joined && ports_.wifi.open(kOwnPort);  // (blocks, up to 2 s)
  if (is_joined && !is_socket_open_) ports_.wifi.leave();
  const uint32_t now_us = ports_.clock.micros();
  join_pause_.start(now_us, is_cable_connected_ ? kJoinPauseWithCableUs : kJoinPauseUs);
  network_trial_.start(now_us, trial_us_);
}

void Wearable::leave_network() {
  ports_.wifi.leave();
  is_socket_open_ = false;
  pairing_.set_lane(Lane::kWifi, false);
}

}  // namespace bunraku
