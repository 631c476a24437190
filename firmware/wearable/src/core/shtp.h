// Cargoes to and from a sensor hub over I2C (SHTP): one bus transaction a call, pieces joined.
#pragma once

#include <stdint.h>

#include "ports.h"

namespace bunraku {

class Shtp {
 public:
  enum class Heard : uint8_t { kError, kNothing, kPart, kCargo };

  explicit Shtp(I2cBus& bus) : bus_(bus) {}

  void use(uint8_t address) { address_ = address, forget(); }
  void forget() { left_ = got_ = 0; }  // drops a cargo that was half read

  // kCargo: channel() and cargo() are whole. kPart: there is more, ask again at once.
  Heard listen();

  bool say(uint8_t channel, const uint8_t* cargo, uint8_t count);  // up to 28 bytes

  uint8_t address() const { return address_; }
  uint8_t channel() const { return channel_; }
  const uint8_t* cargo() const { return cargo_; }
  uint8_t count() const { return got_; }  // at most kRoom: the rest of a longer cargo is dropped

 private:
  static constexpr uint8_t kPiece = 64;   // with its header: 1.5 ms at 400 kHz
  static constexpr uint8_t kRoom = 128;   // an advertisement has more, and says nothing that is needed

  Heard announce();

  I2cBus& bus_;
  uint8_t address_ = 0;
  uint8_t channel_ = 0;
  uint16_t left_ = 0;  // bytes with a header before them, of the cargo that is being read
  uint8_t got_ = 0;
  bool is_cut_ = false;  // pieces do not fit together: the cargo is thrown away
  uint8_t said_[4] = {};  // sequence by channel
  uint8_t cargo_[kRoom] = {};
};

}  // namespace bunraku
