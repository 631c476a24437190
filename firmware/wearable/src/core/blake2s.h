// BLAKE2s (RFC 7693), keyed, one call a message: the tag of every packet. Written for small code.
#pragma once

#include <stdint.h>

namespace bunraku {

// A message and the key it is signed with (0..32 bytes).
struct Signed {
  const uint8_t* key;
  uint8_t key_bytes;
  const uint8_t* data;
  uint16_t count;
};

void blake2s(const Signed& message, uint8_t* digest, uint8_t digest_bytes);  // 1..32

// Takes as long for a wrong tag as for a right one.
bool is_same_tag(const uint8_t* one, const uint8_t* other, uint8_t count);

}  // namespace bunraku
