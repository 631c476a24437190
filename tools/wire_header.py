"""The wire's declaration as C++ for the firmware: one struct a packet, its size, its bytes in and out."""

from __future__ import annotations

from textwrap import wrap

from appliance.sensor import wire
from appliance.sensor.wire import Coding, Layout

TOP = """\
// The packets between a wearable and the box. Made from appliance/sensor/wire.py; do not edit.
// Regenerate it with `python -m tools.generate_wire`.
#pragma once

#include <stdint.h>
#include <string.h>

namespace bunraku {
namespace wire {

constexpr uint16_t kMagic = %(magic)#06x;
constexpr uint8_t kVersion = %(version)d;
constexpr uint32_t kWireHash = %(hash)#010xu;
constexpr uint8_t kKeyBytes = %(key)d;
constexpr uint8_t kTagBytes = %(tag)d;
constexpr uint8_t kHeadBytes = %(head)d;  // magic, version, kind and the fields of every packet
constexpr uint8_t kLargest = %(largest)d;
constexpr uint8_t kBatteryUnknown = %(battery)d;
constexpr uint16_t kRoundTripUnknown = %(round_trip)d;
constexpr uint8_t kHasProfile = %(has_profile)d, kIsNdof = %(is_ndof)d;  // bits of `flags`
constexpr uint8_t kRadioIsOld = %(radio_is_old)d, kHasCrystal = %(has_crystal)d;
constexpr uint8_t kSignalShift = %(signal_shift)d, kMostSteps = %(most_steps)d;  // its upper bits
constexpr int8_t kWeakestDbm = %(weakest_dbm)d, kDbmAStep = %(dbm_a_step)d;
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
"""

PACKET = """
// %(meaning)s
// %(direction)s; `write` fills the first kSignedBytes, the tag follows; `read` does not check the tag.
#define %(macro)s(X) \\
%(fields)s
struct %(name)s {
  static constexpr uint8_t kKind = %(kind)d;
  static constexpr uint8_t kSignedBytes = %(signed)d;
  static constexpr uint8_t kSize = %(size)d;
%(members)s

  void write(uint8_t* at) const {
    put(at, kMagic), put(at, kVersion), put(at, kKind);
    %(macro)s(BUNRAKU_PUT)
  }
  void read(const uint8_t* at) {
    at += sizeof kMagic + sizeof kVersion + sizeof kKind;
    %(macro)s(BUNRAKU_GET)
  }
};
"""

BOTTOM = """
#undef BUNRAKU_PUT
#undef BUNRAKU_GET

}  // namespace wire
}  // namespace bunraku
"""


def header() -> str:
    """All of wire.h."""
    text = TOP % {
        "magic": wire.MAGIC,
        "version": wire.VERSION,
        "hash": wire.WIRE_HASH,
        "key": wire.KEY_BYTES,
        "tag": wire.TAG_BYTES,
        "head": wire.HEAD.size,
        "largest": wire.LARGEST,
        "battery": wire.BATTERY_UNKNOWN,
        "round_trip": wire.ROUND_TRIP_UNKNOWN,
        "has_profile": wire.HAS_PROFILE,
        "is_ndof": wire.IS_NDOF,
        "radio_is_old": wire.RADIO_IS_OLD,
        "has_crystal": wire.HAS_CRYSTAL,
        "signal_shift": wire.SIGNAL_SHIFT,
        "most_steps": wire.MOST_STEPS,
        "weakest_dbm": wire.WEAKEST_DBM,
        "dbm_a_step": wire.DBM_A_STEP,
    }
    return text + "".join(_packet(layout) for layout in wire.LAYOUTS.values()) + BOTTOM


def _packet(layout: Layout) -> str:
    return PACKET % {
        "meaning": layout.meaning,
        "direction": layout.direction[0].upper() + layout.direction[1:],
        "name": layout.name,
        "kind": layout.kind,
        "signed": layout.signed_bytes,
        "size": layout.size,
        "members": "\n".join(_member(*field) for field in layout.fields),
        "macro": f"BUNRAKU_{layout.name.upper()}",
        "fields": " \\\n".join(wrap(" ".join(f"X({name})" for name, _, _ in layout.fields), 106)),
    }


def _member(name: str, coding: Coding, meaning: str) -> str:
    base, _, count = coding.c_type.partition("[")
    length = f"[{count}" if count else f"[{coding.count}]" if coding.count > 1 else ""
    return f"  {base} {name}{length};" + (f"  // {meaning}" if meaning else "")
