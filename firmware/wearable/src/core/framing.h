// Packets and text on one serial line. Packets travel as COBS(packet + CRC-16/XMODEM) between zero bytes; a
// line of text holds no zero byte.
#pragma once

#include <stdint.h>

#include "ports.h"
#include "wire.h"

namespace bunraku {

constexpr uint8_t kCrcBytes = 2;
constexpr uint8_t kLongestStuffed = wire::kLargest + kCrcBytes + 1;  // COBS adds one byte
constexpr uint8_t kLongestFrame = kLongestStuffed + 2;               // with the zero bytes around it
constexpr uint8_t kLongestLine = 128;

uint16_t crc16(const uint8_t* data, uint16_t count);  // XMODEM: polynomial 0x1021, starts with 0

// Writes the whole frame, zero bytes before and after it included, and returns its length.
uint8_t frame(const uint8_t* packet, uint8_t count, uint8_t (&out)[kLongestFrame]);

// Unstuffs in place and checks the CRC; the length of the packet, 0: damaged.
uint8_t unframe(uint8_t* stuffed, uint8_t count);

// Tells packets from text in what a host sends. A zero byte begins a packet and drops a line begun; the next
// one ends it, and text is expected again; also after 0.25 s of silence in a packet, so that typed text gets through.
class CableInput {
 public:
  enum class Found : uint8_t { kNothing, kPacket, kLine, kOverlongLine };

  Found feed(uint8_t byte, uint32_t now_us);
  void reset();  // the cable was pulled

  // Result of the last feed(), until the next one. A line ends with '\0' and is never empty.
  const uint8_t* packet() const { return buffer_; }
  uint8_t packet_bytes() const { return count_; }
  const char* line() const { return reinterpret_cast<const char*>(buffer_); }
  uint32_t damaged() const { return damaged_; }  // packets with wrong length, stuffing or CRC

 private:
  Found feed_packet(uint8_t byte);
  Found feed_text(uint8_t byte);

  uint8_t buffer_[kLongestLine + 1] = {};
  uint8_t count_ = 0;
  bool is_packet_ = false;
  bool is_overlong_ = false;
  bool is_delivered_ = false;  // the buffer was delivered: the next byte starts a new item
  uint32_t fed_us_ = 0;
  uint32_t damaged_ = 0;
};

// Bytes waiting to be written. Takes a frame or an answer whole or not at all; never waits.
class CableOutput {
 public:
  bool put(const uint8_t* data, uint16_t count);
  bool has_room(uint16_t count) const { return count + end_ - begin_ <= kRoom; }
  void flush(SerialPort& serial);
  void reset() { begin_ = end_ = 0; }

 private:
  static constexpr uint16_t kRoom = 320;

  uint8_t buffer_[kRoom] = {};
  uint16_t begin_ = 0, end_ = 0;
};

}  // namespace bunraku
