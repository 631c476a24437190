// Decides which packets a wearable believes, follows its box from lane to lane, and looks for it again.
#include "pairing.h"

#include "blake2s.h"
#include "saturating.h"
#include "version.h"

namespace bunraku {
namespace {

constexpr uint32_t kHelloEveryUs = 500'000;
constexpr uint32_t kCallPauseUs = 200'000;
constexpr uint32_t kSilenceUs = 3'000'000;         // without the box: the link is left
constexpr uint32_t kRestoreWithinUs = 10'000'000;  // after the assignment
constexpr uint32_t kProfileEveryUs = 1'000'000;
constexpr uint8_t kProfilesToSay = 3;
constexpr Lane kGreetingOrder[] = {Lane::kCable, Lane::kWifi};
constexpr uint32_t kOldHellos = 3;  // an assignment may answer the newest hello or one of these before it

uint8_t index(Lane lane) { return static_cast<uint8_t>(lane); }
bool is_newer(uint32_t sequence, uint32_t than) { return static_cast<int32_t>(sequence - than) > 0; }

uint8_t size_from_box(uint8_t kind) {  // 0: not a packet that a box sends
  switch (kind) {
    case wire::Assignment::kKind: return wire::Assignment::kSize;
    case wire::Heartbeat::kKind: return wire::Heartbeat::kSize;
    case wire::Call::kKind: return wire::Call::kSize;
    case wire::Restore::kKind: return wire::Restore::kSize;
    default: return 0;
  }
}

uint8_t supported_rate(uint8_t asked_hz) { return asked_hz >= 100 ? 100 : asked_hz >= 50 ? 50 : 25; }

}  // namespace

void Pairing::begin(uint32_t device_id, const uint8_t (&key)[wire::kKeyBytes], uint32_t boot_nonce) {
  device_id_ = device_id;
  boot_nonce_ = boot_nonce;
  memcpy(key_, key, sizeof key_);
  session_ = 0;
  answered_hello_ = hello_sequence_;  // hellos of before are not to be answered any more
  is_called_ = false;
  leave();
  for (Timer& pause : hello_pause_) pause.stop();
}

void Pairing::leave() {
  link_ = Way();
  heard_.stop();
  restore_window_.stop();
  round_trip_ = wire::kRoundTripUnknown;
  led_ = wire::kLedOff;
}

void Pairing::set_lane(Lane lane, bool is_up) {
  bool& was_up = lane_is_up_[index(lane)];
  if (is_up && !was_up) hello_pause_[index(lane)].stop();
  was_up = is_up;
  if (is_up || link_.lane != lane) return;
  leave();
  for (Timer& pause : hello_pause_) pause.stop();  // greet on the other lane at once
}

Received Pairing::receive(const uint8_t* data, uint16_t count_bytes, const Way& from, const Condition& condition,
                          uint32_t now_us) {
  wire::Call head;  // nothing but what every packet carries
  if (count_bytes < wire::kHeadBytes + wire::kTagBytes) return count(counts_.malformed), Received::kNothing;
  const uint8_t kind = data[3];
  const uint16_t magic = static_cast<uint16_t>(data[0] | data[1] << 8);
  if (magic != wire::kMagic || data[2] != wire::kVersion || count_bytes != size_from_box(kind))
    return count(counts_.malformed), Received::kNothing;
  head.read(data);
  if (device_id_ == 0 || head.device_id != device_id_ || head.boot_nonce != boot_nonce_)
    return count(counts_.foreign), Received::kNothing;
  uint8_t tag[wire::kTagBytes];
  const uint16_t signed_bytes = static_cast<uint16_t>(count_bytes - wire::kTagBytes);
  blake2s({key_, sizeof key_, data, signed_bytes}, tag, sizeof tag);
  if (!is_same_tag(tag, data + signed_bytes, sizeof tag)) return count(counts_.forged), Received::kNothing;
  if (kind == wire::Assignment::kKind) return assigned(data, from, now_us);
  if (kind == wire::Heartbeat::kKind) return heard(data, now_us);
  if (kind == wire::Restore::kKind) return restored(data, condition, now_us);
  return called(from, now_us);
}

Received Pairing::assigned(const uint8_t* data, const Way& from, uint32_t now_us) {
  wire::Assignment assignment;
  assignment.read(data);
  const uint32_t hello = assignment.hello_sequence;
  const bool is_timely = is_newer(hello, answered_hello_) && hello_sequence_ - hello <= kOldHellos;
  if (assignment.session == 0 || !is_timely) return count(counts_.replayed), Received::kNothing;
  answered_hello_ = hello;
  const bool is_better_linked = link_.lane == Lane::kCable && from.lane == Lane::kWifi;
  // A live link keeps its address within a session, else a relay of the box's packets would get the stream.
  const bool is_same_link = link_.lane == from.lane && assignment.session == session_;
  if (is_better_linked || is_same_link) return Received::kNothing;
  if (assignment.session != session_) heartbeat_sequence_ = restore_sequence_ = 0;
  if (!is_linked() || assignment.session != session_) restore_window_.start(now_us, kRestoreWithinUs);
  session_ = assignment.session;
  link_ = from;
  link_.is_broadcast = false;
  heard_.start(now_us, kSilenceUs);
  led_ = assignment.led;
  rate_hz_ = supported_rate(assignment.rate_hz);
  return Received::kAssignment;
}

Received Pairing::heard(const uint8_t* data, uint32_t now_us) {
  wire::Heartbeat heartbeat;
  heartbeat.read(data);
  if (!is_linked() || heartbeat.session != session_ || !is_newer(heartbeat.sequence, heartbeat_sequence_))
    return count(counts_.replayed), Received::kNothing;
  heartbeat_sequence_ = heartbeat.sequence;
  heard_.start(now_us, kSilenceUs);
  led_ = heartbeat.led;
  measure_round_trip(heartbeat, now_us);
  return Received::kHeartbeat;
}

void Pairing::measure_round_trip(const wire::Heartbeat& heartbeat, uint32_t now_us) {
  if (heartbeat.echo_sequence == 0 || reading_sequence_ - heartbeat.echo_sequence >= kRemembered) return;
  const uint32_t away_us = now_us - sent_us_[heartbeat.echo_sequence % kRemembered];
  if (heartbeat.echo_held_us > away_us) return;
  const uint32_t round_trip = (away_us - heartbeat.echo_held_us) / 100;
  if (round_trip < wire::kRoundTripUnknown) round_trip_ = static_cast<uint16_t>(round_trip);
}

Received Pairing::called(const Way& from, uint32_t now_us) {
  if (call_pause_.is_running(now_us)) return Received::kNothing;
  call_pause_.start(now_us, kCallPauseUs);
  answer_to_ = from;
  is_called_ = true;
  return Received::kCall;
}

Received Pairing::restored(const uint8_t* data, const Condition& condition, uint32_t now_us) {
  wire::Restore restore;
  restore.read(data);
  if (restore.session != session_ || !restore_window_.is_running(now_us) ||
      !is_newer(restore.sequence, restore_sequence_))
    return count(counts_.replayed), Received::kNothing;
  restore_sequence_ = restore.sequence;
  if (memcmp(restore.imu_id, condition.imu_id, sizeof restore.imu_id) != 0) return Received::kNothing;
  if (condition.flags & wire::kHasProfile) return Received::kNothing;
  return Received::kRestore;
}

bool Pairing::wants_hello(Lane lane) const {
  if (!lane_is_up_[index(lane)] || device_id_ == 0) return false;
  return !is_linked() || (lane == Lane::kCable && link_.lane == Lane::kWifi);
}

uint8_t Pairing::next(const Condition& condition, uint32_t now_us, uint8_t (&packet)[wire::kLargest], Way& to) {
  call_pause_.is_running(now_us);
  restore_window_.is_running(now_us);
  if (is_linked() && !heard_.is_running(now_us)) leave();
  if (is_called_) {
    is_called_ = false;
    to = answer_to_;
    return hello(condition, packet);
  }
  for (const Lane lane : kGreetingOrder) {
    if (hello_pause_[index(lane)].is_running(now_us) || !wants_hello(lane)) continue;
    hello_pause_[index(lane)].start(now_us, kHelloEveryUs);
    to = Way();
    to.lane = lane;
    to.is_broadcast = lane == Lane::kWifi;
    return hello(condition, packet);
  }
  if (profile_pause_.is_running(now_us) || profiles_left_ == 0 || !is_linked()) return 0;
  --profiles_left_;
  profile_pause_.start(now_us, kProfileEveryUs);
  to = link_;
  return profile(condition, packet);
}

uint8_t Pairing::reading(const Sample& sample, const Condition& condition, uint32_t now_us,
                         uint8_t (&packet)[wire::kLargest], Way& to) {
  if (!is_linked()) return 0;
  wire::Reading reading;
  fill_head(reading, ++reading_sequence_);
  reading.sensor_time_us = sample.measured_us;
  memcpy(reading.orientation, sample.orientation, sizeof reading.orientation);
  reading.calibration = sample.calibration;
  reading.battery = condition.battery;
  reading.round_trip = round_trip_;
  reading.taps = condition.taps;
  reading.recoveries = condition.recoveries;
  reading.flags = condition.flags;
  sent_us_[reading_sequence_ % kRemembered] = now_us;
  to = link_;
  return sign(reading, packet);
}

void Pairing::introduce() {
  if (!is_linked()) return;
  answer_to_ = link_;
  is_called_ = true;
}

void Pairing::announce_profile(const uint8_t* offsets22) {
  memcpy(offsets_, offsets22, sizeof offsets_);
  profiles_left_ = kProfilesToSay;
  profile_pause_.stop();
}

uint8_t Pairing::hello(const Condition& condition, uint8_t* packet) {
  wire::Hello hello;
  fill_head(hello, ++hello_sequence_);
  hello.wire_hash = wire::kWireHash;
  hello.firmware_major = kFirmwareMajor;
  hello.firmware_minor = kFirmwareMinor;
  hello.firmware_patch = kFirmwarePatch;
  hello.battery = condition.battery;
  hello.flags = condition.flags;
  memcpy(hello.imu_id, condition.imu_id, sizeof hello.imu_id);
  return sign(hello, packet);
}

uint8_t Pairing::profile(const Condition& condition, uint8_t* packet) {
  wire::Profile profile;
  fill_head(profile, ++profile_sequence_);
  memcpy(profile.imu_id, condition.imu_id, sizeof profile.imu_id);
  memcpy(profile.offsets, offsets_, sizeof profile.offsets);
  return sign(profile, packet);
}

template <typename Packet>
void Pairing::fill_head(Packet& packet, uint32_t sequence) const {
  packet.device_id = device_id_;
  packet.boot_nonce = boot_nonce_;
  packet.session = session_;
  packet.sequence = sequence;
}

template <typename Packet>
uint8_t Pairing::sign(const Packet& packet, uint8_t* data) const {
  packet.write(data);
  blake2s({key_, sizeof key_, data, Packet::kSignedBytes}, data + Packet::kSignedBytes, wire::kTagBytes);
  return Packet::kSize;
}

}  // namespace bunraku
