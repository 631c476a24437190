// The number that tells one power-on of a wearable from all others.
#pragma once

#include <stdint.h>

#include "ports.h"
#include "wire.h"

namespace bunraku {

// Keyed BLAKE2s of the count of power-ons and noise: does not repeat even where one of them fails. Never 0.
uint32_t draw_boot_nonce(const uint8_t (&key)[wire::kKeyBytes], FlashStore& flash, Board& board);

}  // namespace bunraku
