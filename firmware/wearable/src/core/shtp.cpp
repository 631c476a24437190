// SHTP over I2C: every read begins with a header; reading nothing but the header takes nothing away.
#include "shtp.h"

#include <string.h>

#include "sh2.h"

namespace bunraku {
namespace {

using namespace sh2;

constexpr uint16_t kLongest = 1024;  // what claims more is noise on the bus
constexpr uint8_t kMostSaid = 28;
constexpr uint8_t kChannels = 6;

}  // namespace

Shtp::Heard Shtp::listen() {
  if (left_ == 0) return announce();
  uint8_t piece[kPiece];
  const uint8_t count = left_ < kPiece ? static_cast<uint8_t>(left_) : kPiece;
  if (!bus_.receive(address_, piece, count)) return Heard::kError;
  const uint16_t length = value(piece) & ~kContinued;
  if (length != left_ || piece[2] != channel_) is_cut_ = true;
  const uint8_t payload = static_cast<uint8_t>(count - kHeaderBytes);
  const uint8_t kept = payload < kRoom - got_ ? payload : static_cast<uint8_t>(kRoom - got_);
  memcpy(cargo_ + got_, piece + kHeaderBytes, kept);
  got_ = static_cast<uint8_t>(got_ + kept);
  left_ = static_cast<uint16_t>(left_ - payload);
  if (left_ > kHeaderBytes) return Heard::kPart;
  left_ = 0;
  return is_cut_ ? Heard::kNothing : Heard::kCargo;
}

Shtp::Heard Shtp::announce() {
  uint8_t header[kHeaderBytes];
  if (!bus_.receive(address_, header, kHeaderBytes)) return Heard::kError;
  const uint16_t length = value(header) & ~kContinued;
  got_ = 0;
  is_cut_ = false;
  if (length <= kHeaderBytes || length > kLongest || header[2] >= kChannels) return Heard::kNothing;
  left_ = length;
  channel_ = header[2];
  return Heard::kPart;
}

bool Shtp::say(uint8_t channel, const uint8_t* cargo, uint8_t count) {
  if (count > kMostSaid || channel >= sizeof said_) return false;
  uint8_t bytes[kHeaderBytes + kMostSaid] = {static_cast<uint8_t>(kHeaderBytes + count), 0, channel,
                                             said_[channel]};
  memcpy(bytes + kHeaderBytes, cargo, count);
  ++said_[channel];
  return bus_.write(address_, bytes[0], bytes + 1, static_cast<uint8_t>(kHeaderBytes - 1 + count));
}

}  // namespace bunraku
