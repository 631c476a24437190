// The packets between a wearable and the box. Made from appliance/sensor/wire.py; do not edit.
// Regenerate it with `python -m tools.generate_wire`.
#pragma once

#include <stdint.h>
#include <string.h>

namespace bunraku {
namespace wire {

constexpr uint16_t kMagic = 0x4b42;
constexpr uint8_t kVersion = 1;
constexpr uint32_t kWireHash = 0x2d20a5dfu;
constexpr uint8_t kKeyBytes = 16;
constexpr uint8_t kTagBytes = 8;
constexpr uint8_t kHeadBytes = 20;  // magic, version, kind and the fields of every packet
constexpr uint8_t kLargest = 66;
constexpr uint8_t kBatteryUnknown = 255;
constexpr uint16_t kRoundTripUnknown = 65535;
constexpr uint8_t kHasProfile = 1, kIsNdof = 2;  // bits of `flags`
constexpr uint8_t kRadioIsOld = 4, kHasCrystal = 8;
constexpr uint8_t kSignalShift = 4, kMostSteps = 15;  // its upper bits
constexpr int8_t kWeakestDbm = -90, kDbmAStep = 4;
enum Led : uint8_t { kLedOff, kLedOn, kLedSlow, kLedFast, kLedStrobe };

inline void put(uint8_t*& at, uint8_t value) { *at++ = value; }
inline void put(uint8_t*& at, uint16_t value) {
  put(at, static_cast<uint8_t>(value));
  put(at, static_cast<uint8_t>(value >> 8));
}
inline void put(uint8_t*& at, uint32_t value) {
  put(at, static_cast<uint16_t>(value));
  put(at, static_cast<uint16_t>(value >> 16));
}
inline void put(uint8_t*& at, int16_t value) { put(at, static_cast<uint16_t>(value)); }
inline void get(const uint8_t*& at, uint8_t& value) { value = *at++; }
inline void get(const uint8_t*& at, uint16_t& value) {
  value = static_cast<uint16_t>(at[0] | at[1] << 8);
  at += 2;
}
inline void get(const uint8_t*& at, uint32_t& value) {
  value = at[0] | static_cast<uint32_t>(at[1]) << 8 | static_cast<uint32_t>(at[2]) << 16 |
          static_cast<uint32_t>(at[3]) << 24;
  at += 4;
}
inline void get(const uint8_t*& at, int16_t& value) {
  uint16_t bits;
  get(at, bits);
  memcpy(&value, &bits, sizeof value);
}
template <typename Value, uint8_t count>
void put(uint8_t*& at, const Value (&values)[count]) {
  for (const Value& value : values) put(at, value);
}
template <typename Value, uint8_t count>
void get(const uint8_t*& at, Value (&values)[count]) {
  for (Value& value : values) get(at, value);
}

// Each packet has its fields as a macro too: one list for writing, reading and the tests.
#define BUNRAKU_PUT(field) put(at, field);
#define BUNRAKU_GET(field) get(at, field);

// The sensor is on and looks for its box: every 500 ms on network and cable, broadcast on Wi-Fi.
// Sensor to box; `write` fills the first kSignedBytes, the tag follows; `read` does not check the tag.
#define BUNRAKU_HELLO(X) \
X(device_id) X(boot_nonce) X(session) X(sequence) X(wire_hash) X(firmware_major) X(firmware_minor) \
X(firmware_patch) X(battery) X(flags) X(imu_id)
struct Hello {
  static constexpr uint8_t kKind = 1;
  static constexpr uint8_t kSignedBytes = 45;
  static constexpr uint8_t kSize = 53;
  uint32_t device_id;  // which sensor, as in the key file
  uint32_t boot_nonce;  // random, drawn by the sensor at each power-on
  uint32_t session;  // given by the box to this power-on, by a hash with its secret; 0 before one
  uint32_t sequence;  // counts this kind of packet from this sender to this receiver, since its start
  uint32_t wire_hash;  // hash of this declaration; a mismatch means that one side needs an update
  uint8_t firmware_major;  // firmware version
  uint8_t firmware_minor;
  uint8_t firmware_patch;
  uint8_t battery;  // percent; 255 unknown
  uint8_t flags;  // bit 0: a calibration profile is in use; bit 1: fusion with the magnetometer (NDOF); bit 2: the radio's own firmware is older than 19.5.4; bit 3: the IMU runs by a crystal; bits 4 to 7: n > 0: the Wi-Fi had 4 n - 90 dBm when it was joined
  uint8_t imu_id[16];  // unique id of the IMU; its calibration is kept under it

  void write(uint8_t* at) const {
    put(at, kMagic), put(at, kVersion), put(at, kKind);
    BUNRAKU_HELLO(BUNRAKU_PUT)
  }
  void read(const uint8_t* at) {
    at += sizeof kMagic + sizeof kVersion + sizeof kKind;
    BUNRAKU_HELLO(BUNRAKU_GET)
  }
};

// The box takes the sensor, which then streams to the sender of this packet. Bound to one hello.
// Box to sensor; `write` fills the first kSignedBytes, the tag follows; `read` does not check the tag.
#define BUNRAKU_ASSIGNMENT(X) \
X(device_id) X(boot_nonce) X(session) X(sequence) X(hello_sequence) X(hand) X(rate_hz) X(led)
struct Assignment {
  static constexpr uint8_t kKind = 2;
  static constexpr uint8_t kSignedBytes = 27;
  static constexpr uint8_t kSize = 35;
  uint32_t device_id;  // which sensor, as in the key file
  uint32_t boot_nonce;  // random, drawn by the sensor at each power-on
  uint32_t session;  // given by the box to this power-on, by a hash with its secret; 0 before one
  uint32_t sequence;  // counts this kind of packet from this sender to this receiver, since its start
  uint32_t hello_sequence;  // sequence of the hello that it answers
  uint8_t hand;  // which hand of the show, from 0; 255 none
  uint8_t rate_hz;  // readings a second
  uint8_t led;  // 0 off, 1 on, 2 slow, 3 fast, 4 strobe

  void write(uint8_t* at) const {
    put(at, kMagic), put(at, kVersion), put(at, kKind);
    BUNRAKU_ASSIGNMENT(BUNRAKU_PUT)
  }
  void read(const uint8_t* at) {
    at += sizeof kMagic + sizeof kVersion + sizeof kKind;
    BUNRAKU_ASSIGNMENT(BUNRAKU_GET)
  }
};

// One orientation of the sensor, at the rate of the assignment: 50 or 100 a second.
// Sensor to box; `write` fills the first kSignedBytes, the tag follows; `read` does not check the tag.
#define BUNRAKU_READING(X) \
X(device_id) X(boot_nonce) X(session) X(sequence) X(sensor_time_us) X(orientation) X(calibration) \
X(battery) X(round_trip) X(taps) X(recoveries) X(flags)
struct Reading {
  static constexpr uint8_t kKind = 3;
  static constexpr uint8_t kSignedBytes = 39;
  static constexpr uint8_t kSize = 47;
  uint32_t device_id;  // which sensor, as in the key file
  uint32_t boot_nonce;  // random, drawn by the sensor at each power-on
  uint32_t session;  // given by the box to this power-on, by a hash with its secret; 0 before one
  uint32_t sequence;  // counts this kind of packet from this sender to this receiver, since its start
  uint32_t sensor_time_us;  // device clock at the measurement; wraps after 71.6 minutes
  int16_t orientation[4];  // w, x, y, z; 16384 stands for 1; from the case to the room
  uint8_t calibration;  // system, gyroscope, accelerometer, magnetometer: two bits each, 3 is best
  uint8_t battery;  // percent; 255 unknown
  uint16_t round_trip;  // newest round trip by a heartbeat's echo, 0.1 ms; 65535 unknown
  uint8_t taps;  // counts double taps since power-on; wraps
  uint8_t recoveries;  // counts restarts of the fusion since power-on; wraps; its heading is lost
  uint8_t flags;  // bit 0: a calibration profile is in use; bit 1: fusion with the magnetometer (NDOF); bit 2: the radio's own firmware is older than 19.5.4; bit 3: the IMU runs by a crystal; bits 4 to 7: n > 0: the Wi-Fi had 4 n - 90 dBm when it was joined

  void write(uint8_t* at) const {
    put(at, kMagic), put(at, kVersion), put(at, kKind);
    BUNRAKU_READING(BUNRAKU_PUT)
  }
  void read(const uint8_t* at) {
    at += sizeof kMagic + sizeof kVersion + sizeof kKind;
    BUNRAKU_READING(BUNRAKU_GET)
  }
};

// The box is there: every second, and at once when the light changes. After three seconds without it the sensor sends hellos again.
// Box to sensor; `write` fills the first kSignedBytes, the tag follows; `read` does not check the tag.
#define BUNRAKU_HEARTBEAT(X) \
X(device_id) X(boot_nonce) X(session) X(sequence) X(echo_sequence) X(echo_held_us) X(led)
struct Heartbeat {
  static constexpr uint8_t kKind = 4;
  static constexpr uint8_t kSignedBytes = 29;
  static constexpr uint8_t kSize = 37;
  uint32_t device_id;  // which sensor, as in the key file
  uint32_t boot_nonce;  // random, drawn by the sensor at each power-on
  uint32_t session;  // given by the box to this power-on, by a hash with its secret; 0 before one
  uint32_t sequence;  // counts this kind of packet from this sender to this receiver, since its start
  uint32_t echo_sequence;  // sequence of the newest reading that arrived
  uint32_t echo_held_us;  // how long the box held that reading before this packet left
  uint8_t led;  // 0 off, 1 on, 2 slow, 3 fast, 4 strobe

  void write(uint8_t* at) const {
    put(at, kMagic), put(at, kVersion), put(at, kKind);
    BUNRAKU_HEARTBEAT(BUNRAKU_PUT)
  }
  void read(const uint8_t* at) {
    at += sizeof kMagic + sizeof kVersion + sizeof kKind;
    BUNRAKU_HEARTBEAT(BUNRAKU_GET)
  }
};

// The box does not know the session of a reading, because it was restarted: send a hello at once.
// Box to sensor; `write` fills the first kSignedBytes, the tag follows; `read` does not check the tag.
#define BUNRAKU_CALL(X) \
X(device_id) X(boot_nonce) X(session) X(sequence)
struct Call {
  static constexpr uint8_t kKind = 5;
  static constexpr uint8_t kSignedBytes = 20;
  static constexpr uint8_t kSize = 28;
  uint32_t device_id;  // which sensor, as in the key file
  uint32_t boot_nonce;  // random, drawn by the sensor at each power-on
  uint32_t session;  // given by the box to this power-on, by a hash with its secret; 0 before one
  uint32_t sequence;  // counts this kind of packet from this sender to this receiver, since its start

  void write(uint8_t* at) const {
    put(at, kMagic), put(at, kVersion), put(at, kKind);
    BUNRAKU_CALL(BUNRAKU_PUT)
  }
  void read(const uint8_t* at) {
    at += sizeof kMagic + sizeof kVersion + sizeof kKind;
    BUNRAKU_CALL(BUNRAKU_GET)
  }
};

// A calibration that the sensor has learned, for the box to keep: an update erases the sensor's copy.
// Sensor to box; `write` fills the first kSignedBytes, the tag follows; `read` does not check the tag.
#define BUNRAKU_PROFILE(X) \
X(device_id) X(boot_nonce) X(session) X(sequence) X(imu_id) X(offsets)
struct Profile {
  static constexpr uint8_t kKind = 6;
  static constexpr uint8_t kSignedBytes = 58;
  static constexpr uint8_t kSize = 66;
  uint32_t device_id;  // which sensor, as in the key file
  uint32_t boot_nonce;  // random, drawn by the sensor at each power-on
  uint32_t session;  // given by the box to this power-on, by a hash with its secret; 0 before one
  uint32_t sequence;  // counts this kind of packet from this sender to this receiver, since its start
  uint8_t imu_id[16];  // unique id of the IMU
  uint8_t offsets[22];  // as the IMU has it; the box does not look inside

  void write(uint8_t* at) const {
    put(at, kMagic), put(at, kVersion), put(at, kKind);
    BUNRAKU_PROFILE(BUNRAKU_PUT)
  }
  void read(const uint8_t* at) {
    at += sizeof kMagic + sizeof kVersion + sizeof kKind;
    BUNRAKU_PROFILE(BUNRAKU_GET)
  }
};

// A kept calibration for a sensor that has none, with the first five heartbeats.
// Box to sensor; `write` fills the first kSignedBytes, the tag follows; `read` does not check the tag.
#define BUNRAKU_RESTORE(X) \
X(device_id) X(boot_nonce) X(session) X(sequence) X(imu_id) X(offsets)
struct Restore {
  static constexpr uint8_t kKind = 7;
  static constexpr uint8_t kSignedBytes = 58;
  static constexpr uint8_t kSize = 66;
  uint32_t device_id;  // which sensor, as in the key file
  uint32_t boot_nonce;  // random, drawn by the sensor at each power-on
  uint32_t session;  // given by the box to this power-on, by a hash with its secret; 0 before one
  uint32_t sequence;  // counts this kind of packet from this sender to this receiver, since its start
  uint8_t imu_id[16];  // unique id of the IMU that it is for
  uint8_t offsets[22];  // as that IMU gave it

  void write(uint8_t* at) const {
    put(at, kMagic), put(at, kVersion), put(at, kKind);
    BUNRAKU_RESTORE(BUNRAKU_PUT)
  }
  void read(const uint8_t* at) {
    at += sizeof kMagic + sizeof kVersion + sizeof kKind;
    BUNRAKU_RESTORE(BUNRAKU_GET)
  }
};

#undef BUNRAKU_PUT
#undef BUNRAKU_GET

}  // namespace wire
}  // namespace bunraku
