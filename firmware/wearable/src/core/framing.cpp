// COBS and CRC; packets told from text by zero bytes.
#include "framing.h"

#include <string.h>

namespace bunraku {
namespace {

constexpr uint32_t kPatienceUs = 250'000;
constexpr uint8_t kBackspace = 0x08, kDelete = 0x7F;

}  // namespace

uint16_t crc16(const uint8_t* data, uint16_t count) {
  uint16_t crc = 0;
  for (uint16_t i = 0; i < count; ++i) {
    crc = static_cast<uint16_t>(crc ^ data[i] << 8);
    for (uint8_t bit = 0; bit < 8; ++bit) crc = static_cast<uint16_t>(crc & 0x8000 ? crc << 1 ^ 0x1021 : crc << 1);
  }
  return crc;
}

uint8_t frame(const uint8_t* packet, uint8_t count, uint8_t (&out)[kLongestFrame]) {
  const uint16_t crc = crc16(packet, count);
  uint8_t end = 0;
  out[end++] = 0;
  uint8_t code_at = end++;
  for (uint8_t i = 0; i < count + kCrcBytes; ++i) {
    const uint8_t byte = i < count ? packet[i] : static_cast<uint8_t>(i == count ? crc : crc >> 8);
    if (byte == 0) {
      out[code_at] = static_cast<uint8_t>(end - code_at);
      code_at = end++;
    } else {
      out[end++] = byte;
    }
  }
  out[code_at] = static_cast<uint8_t>(end - code_at);
  out[end++] = 0;
  return end;
}

uint8_t unframe(uint8_t* stuffed, uint8_t count) {
  uint8_t written = 0;
  for (uint8_t at = 0; at < count;) {
    const uint8_t code = stuffed[at++];
    if (code == 0 || code - 1 > count - at) return 0;
    for (uint8_t i = 1; i < code; ++i) {
      if (stuffed[at] == 0) return 0;
      stuffed[written++] = stuffed[at++];
    }
    if (at < count) stuffed[written++] = 0;
  }
  if (written <= kCrcBytes) return 0;
  const uint8_t packet_bytes = static_cast<uint8_t>(written - kCrcBytes);
  const uint16_t crc = static_cast<uint16_t>(stuffed[packet_bytes] | stuffed[packet_bytes + 1] << 8);
  return crc16(stuffed, packet_bytes) == crc ? packet_bytes : uint8_t{0};
}

CableInput::Found CableInput::feed(uint8_t byte, uint32_t now_us) {
  if (is_delivered_) count_ = 0, is_overlong_ = false, is_delivered_ = false;
  if (is_packet_ && now_us - fed_us_ > kPatienceUs) reset();
  fed_us_ = now_us;
  const Found found = is_packet_ ? feed_packet(byte) : feed_text(byte);
  is_delivered_ = found != Found::kNothing;
  return found;
}

void CableInput::reset() {
  count_ = 0;
  is_packet_ = is_overlong_ = is_delivered_ = false;
}

CableInput::Found CableInput::feed_packet(uint8_t byte) {
  if (byte != 0) {
    if (count_ < kLongestStuffed)
      buffer_[count_++] = byte;
    else
      is_overlong_ = true;
    return Found::kNothing;
  }
  if (count_ == 0) return Found::kNothing;  // zero bytes in a row: the packet is still to come
  const uint8_t packet_bytes = is_overlong_ ? uint8_t{0} : unframe(buffer_, count_);
  reset();
  count_ = packet_bytes;
  if (packet_bytes > 0) return Found::kPacket;
  ++damaged_;
  return Found::kNothing;
}

CableInput::Found CableInput::feed_text(uint8_t byte) {
  if (byte == 0) {
    reset();
    is_packet_ = true;
    return Found::kNothing;
  }
  if (byte == '\r' || byte == '\n') {
    if (count_ == 0) return Found::kNothing;
    buffer_[count_] = '\0';
    return is_overlong_ ? Found::kOverlongLine : Found::kLine;
  }
  if (byte == kBackspace || byte == kDelete) {
    if (count_ > 0 && !is_overlong_) --count_;
  } else if (count_ < kLongestLine) {
    buffer_[count_++] = byte;
  } else {
    is_overlong_ = true;
  }
  return Found::kNothing;
}

bool CableOutput::put(const uint8_t* data, uint16_t count) {
  if (begin_ > 0) {
    memmove(buffer_, buffer_ + begin_, static_cast<size_t>(end_ - begin_));
    end_ = static_cast<uint16_t>(end_ - begin_);
    begin_ = 0;
  }
  if (!has_room(count)) return false;
  memcpy(buffer_ + end_, data, count);
  end_ = static_cast<uint16_t>(end_ + count);
  return true;
}

void CableOutput::flush(SerialPort& serial) {
  if (begin_ == end_) return;
  const uint16_t waiting = static_cast<uint16_t>(end_ - begin_);
  begin_ = static_cast<uint16_t>(begin_ + serial.write(buffer_ + begin_, waiting));
  if (begin_ == end_) begin_ = end_ = 0;
}

}  // namespace bunraku
