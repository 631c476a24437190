// A box small enough for the micro:bit: assigns one wearable, beats, and believes only what is signed and new.
#pragma once

#include "wire.h"

namespace bunraku {

class SmallBox {
 public:
  SmallBox(uint32_t device_id, const uint8_t (&key)[wire::kKeyBytes]);

  void hear(const uint8_t* data, uint16_t count, uint32_t now_us);
  uint8_t answer(uint8_t (&packet)[wire::kLargest], uint32_t now_us);  // 0: nothing is due

  uint8_t rate_hz = 50;    // of the next assignment
  bool is_silent = false;  // sends no heartbeats
  uint32_t hellos = 0, readings = 0;
  uint32_t refused = 0;  // wrong length, tag, session or order
  uint32_t lost = 0;     // gaps in the readings' sequence
  uint16_t round_trip = wire::kRoundTripUnknown;

 private:
  template <typename Packet>
  bool is_authentic(const uint8_t* data, uint16_t count) const;
  template <typename Packet>
  uint8_t sign(const Packet& packet, uint8_t* data) const;

  const uint32_t device_id_;
  uint8_t key_[wire::kKeyBytes];
  wire::Hello hello_ = {};
  wire::Reading newest_ = {};
  uint32_t heard_us_ = 0, beat_us_ = 0;
  uint32_t sequence_ = 0;
  bool is_greeted_ = false;
};

}  // namespace bunraku
