// Pairing: which box this wearable belongs to, by which way, in which session. Reads no clock, owns no port.
#pragma once

#include <stdint.h>

#include "ports.h"
#include "timer.h"
#include "wire.h"

namespace bunraku {

enum class Lane : uint8_t { kWifi, kCable, kNone };
constexpr uint8_t kLanes = 2;

// Where a packet came from or goes to. On the cable only `lane` counts.
struct Way {
  Lane lane = Lane::kNone;
  bool is_broadcast = false;  // to the box's port at everyone on the network
  Address address = {0, 0};
};

// The packets' facts about the wearable that do not concern pairing.
struct Condition {
  uint8_t battery;      // percent; 255 unknown
  uint8_t flags;        // wire::kHasProfile, wire::kIsNdof
  uint8_t taps, recoveries;
  uint8_t imu_id[16];   // zeros: none found
};

// Why packets were not believed.
struct PairingCounts {
  uint16_t malformed = 0;  // length, magic, version, or a kind that only a sensor sends (a reflected one)
  uint16_t foreign = 0;    // another device, or another power-on of this one
  uint16_t forged = 0;     // the tag is wrong
  uint16_t replayed = 0;   // old session, old sequence, or the answer to an old hello
};

enum class Received : uint8_t { kNothing, kAssignment, kHeartbeat, kCall, kRestore };

class Pairing {
 public:
  // Starts with no link and no session; device 0 accepts no packet. Sequences continue where they were, so that no
  // packet ever repeats.
  void begin(uint32_t device_id, const uint8_t (&key)[wire::kKeyBytes], uint32_t boot_nonce);

  // A lane came up (greeted at once) or went down (a link on it is left at once). Call it as often as wished.
  void set_lane(Lane lane, bool is_up);

  // One packet from anyone. kRestore: authentic, in time, for `condition.imu_id`, and wanted; the caller
  // reads the wire::Restore in `data` and applies it.
  Received receive(const uint8_t* data, uint16_t count_bytes, const Way& from, const Condition& condition,
                   uint32_t now_us);

  // The next packet that is due (hello, profile) and where it goes; 0: nothing is. Call until 0: at most four
  // packets a moment. Also notices that the box has gone silent.
  uint8_t next(const Condition& condition, uint32_t now_us, uint8_t (&packet)[wire::kLargest], Way& to);

  // One reading for the box; 0 while not linked.
  uint8_t reading(const Sample& sample, const Condition& condition, uint32_t now_us,
                  uint8_t (&packet)[wire::kLargest], Way& to);

  // The contents of a hello changed: send another one to the link.
  void introduce();

  // A calibration was saved: tells the box three times, a second apart, as soon as linked.
  void announce_profile(const uint8_t* offsets22);

  bool is_linked() const { return link_.lane != Lane::kNone; }
  const Way& link() const { return link_; }
  uint32_t session() const { return session_; }
  uint8_t led() const { return led_; }  // what the box asked for last: wire::Led
  uint8_t rate_hz() const { return rate_hz_; }  // 25, 50 or 100
  uint16_t round_trip() const { return round_trip_; }  // 0.1 ms; 65535 unknown
  uint32_t readings() const { return reading_sequence_; }
  const PairingCounts& counts() const { return counts_; }

 private:
  static constexpr uint8_t kRemembered = 64;  // readings with a known time of sending, for the round trip

  Received assigned(const uint8_t* data, const Way& from, uint32_t now_us);
  Received heard(const uint8_t* data, uint32_t now_us);
  Received called(const Way& from, uint32_t now_us);
  Received restored(const uint8_t* data, const Condition& condition, uint32_t now_us);
  void measure_round_trip(const wire::Heartbeat& heartbeat, uint32_t now_us);
  bool wants_hello(Lane lane) const;
  uint8_t hello(const Condition& condition, uint8_t* packet);
  uint8_t profile(const Condition& condition, uint8_t* packet);
  template <typename Packet>
  uint8_t sign(const Packet& packet, uint8_t* data) const;
  template <typename Packet>
  void fill_head(Packet& packet, uint32_t sequence) const;
  void leave();

  uint32_t device_id_ = 0, boot_nonce_ = 0;
  uint8_t key_[wire::kKeyBytes] = {};
  bool lane_is_up_[kLanes] = {};
  Timer hello_pause_[kLanes];
  Way link_;
  Way answer_to_;           // origin of a call, or of the link
  bool is_called_ = false;  // a hello there is due
  Timer call_pause_;
  Timer heard_;             // runs while the box was heard in the last 3 s
  Timer restore_window_;    // runs for 10 s after an assignment
  uint32_t session_ = 0;
  uint32_t hello_sequence_ = 0, reading_sequence_ = 0, profile_sequence_ = 0;
  uint32_t answered_hello_ = 0;  // the newest that an assignment was accepted for
  uint32_t heartbeat_sequence_ = 0, restore_sequence_ = 0;  // newest of this session; 0: none
  uint32_t sent_us_[kRemembered] = {};
  uint16_t round_trip_ = wire::kRoundTripUnknown;
  uint8_t led_ = wire::kLedOff;
  uint8_t rate_hz_ = 50;
  uint8_t offsets_[22] = {};
  uint8_t profiles_left_ = 0;
  Timer profile_pause_;
  PairingCounts counts_;
};

}  // namespace bunraku
