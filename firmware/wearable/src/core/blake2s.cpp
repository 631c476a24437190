// BLAKE2s as in RFC 7693, section 3; the message permutations are packed two to a byte.
#include "blake2s.h"

#include <string.h>

namespace bunraku {
namespace {

constexpr uint8_t kBlockBytes = 64;
constexpr uint8_t kRounds = 10;
constexpr uint32_t kStart[8] = {0x6A09E667, 0xBB67AE85, 0x3C6EF372, 0xA54FF53A,
                                0x510E527F, 0x9B05688C, 0x1F83D9AB, 0x5BE0CD19};
constexpr uint8_t kOrder[kRounds][8] = {
    {0x01, 0x23, 0x45, 0x67, 0x89, 0xAB, 0xCD, 0xEF}, {0xEA, 0x48, 0x9F, 0xD6, 0x1C, 0x02, 0xB7, 0x53},
    {0xB8, 0xC0, 0x52, 0xFD, 0xAE, 0x36, 0x71, 0x94}, {0x79, 0x31, 0xDC, 0xBE, 0x26, 0x5A, 0x40, 0xF8},
    {0x90, 0x57, 0x24, 0xAF, 0xE1, 0xBC, 0x68, 0x3D}, {0x2C, 0x6A, 0x0B, 0x83, 0x4D, 0x75, 0xFE, 0x19},
    {0xC5, 0x1F, 0xED, 0x4A, 0x07, 0x63, 0x92, 0x8B}, {0xDB, 0x7E, 0xC1, 0x39, 0x50, 0xF4, 0x86, 0x2A},
    {0x6F, 0xE9, 0xB3, 0x08, 0xC2, 0xD7, 0x14, 0xA5}, {0xA2, 0x84, 0x76, 0x15, 0xFB, 0x9E, 0x3C, 0xD0}};

uint32_t turn(uint32_t value, uint8_t bits) { return value >> bits | value << (32 - bits); }

void mix(uint32_t* v, uint8_t step, uint32_t one, uint32_t other) {
  const uint8_t column = step & 3, shift = step >> 2;  // steps 0..3 mix columns, 4..7 diagonals
  uint32_t& a = v[column];
  uint32_t& b = v[4 + ((column + shift) & 3)];
  uint32_t& c = v[8 + ((column + 2 * shift) & 3)];
  uint32_t& d = v[12 + ((column + 3 * shift) & 3)];
  a += b + one;
  d = turn(d ^ a, 16);
  c += d;
  b = turn(b ^ c, 12);
  a += b + other;
  d = turn(d ^ a, 8);
  c += d;
  b = turn(b ^ c, 7);
}

void compress(uint32_t* state, const uint8_t* block, uint32_t bytes_so_far, bool is_last) {
  uint32_t v[16], m[16];
  for (uint8_t i = 0; i < 16; ++i, block += 4)
    m[i] = block[0] | static_cast<uint32_t>(block[1]) << 8 | static_cast<uint32_t>(block[2]) << 16 |
           static_cast<uint32_t>(block[3]) << 24;
  memcpy(v, state, 32);
  memcpy(v + 8, kStart, 32);
  v[12] ^= bytes_so_far;
  if (is_last) v[14] = ~v[14];
  for (const auto& order : kOrder)
    for (uint8_t step = 0; step < 8; ++step) mix(v, step, m[order[step] >> 4], m[order[step] & 15]);
  for (uint8_t i = 0; i < 8; ++i) state[i] ^= v[i] ^ v[i + 8];
}

}  // namespace

void blake2s(const Signed& message, uint8_t* digest, uint8_t digest_bytes) {
  uint32_t state[8];
  memcpy(state, kStart, sizeof state);
  state[0] ^= 0x01010000u ^ static_cast<uint32_t>(message.key_bytes) << 8 ^ digest_bytes;
  uint8_t block[kBlockBytes] = {};
  uint32_t bytes_so_far = 0;
  const uint8_t* data = message.data;
  uint16_t left = message.count;
  if (message.key_bytes > 0) {  // the key is a separate block before the message
    memcpy(block, message.key, message.key_bytes);
    bytes_so_far = kBlockBytes;
    compress(state, block, bytes_so_far, left == 0);
  }
  while (left > 0 || bytes_so_far == 0) {
    const uint8_t part = left < kBlockBytes ? static_cast<uint8_t>(left) : kBlockBytes;
    memset(block, 0, sizeof block);
    if (part > 0) memcpy(block, data, part);
    data += part;
    left = static_cast<uint16_t>(left - part);
    bytes_so_far += part;
    compress(state, block, bytes_so_far, left == 0);
    if (bytes_so_far == 0) break;  // the empty message is one block of zeros
  }
  for (uint8_t i = 0; i < digest_bytes; ++i) digest[i] = static_cast<uint8_t>(state[i >> 2] >> 8 * (i & 3));
}

bool is_same_tag(const uint8_t* one, const uint8_t* other, uint8_t count) {
  uint8_t difference = 0;
  for (uint8_t i = 0; i < count; ++i) difference = static_cast<uint8_t>(difference | (one[i] ^ other[i]));
  return difference == 0;
}

}  // namespace bunraku
