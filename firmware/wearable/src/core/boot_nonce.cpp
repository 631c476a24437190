// A power-on's own number: the count gives uniqueness, the noise covers an erased flash.
#include "boot_nonce.h"

#include "blake2s.h"
#include "settings.h"

namespace bunraku {

uint32_t draw_boot_nonce(const uint8_t (&key)[wire::kKeyBytes], FlashStore& flash, Board& board) {
  constexpr uint8_t kCountBytes = 4, kNumberBytes = 4, kNoiseBytes = 16;
  uint8_t message[kCountBytes + kNumberBytes + kNoiseBytes];
  uint8_t* at = message;
  wire::put(at, count_boot(flash));
  wire::put(at, board.serial_number());
  board.noise(at, kNoiseBytes);
  uint8_t digest[4];
  blake2s({key, sizeof key, message, sizeof message}, digest, sizeof digest);
  uint32_t nonce;
  const uint8_t* from = digest;
  wire::get(from, nonce);
  return nonce != 0 ? nonce : 1;
}

}  // namespace bunraku
