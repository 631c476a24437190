// BLAKE2s against RFC 7693 and hashlib.
#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "blake2s.h"

using namespace bunraku;

namespace {

std::string hex(const std::vector<uint8_t>& bytes) {
  std::string text;
  for (const uint8_t byte : bytes) {
    text += "0123456789abcdef"[byte >> 4];
    text += "0123456789abcdef"[byte & 15];
  }
  return text;
}

std::vector<uint8_t> counting(size_t count) {
  std::vector<uint8_t> bytes(count);
  for (size_t i = 0; i < count; ++i) bytes[i] = static_cast<uint8_t>(i);
  return bytes;
}

std::string digest(const std::vector<uint8_t>& key, const std::vector<uint8_t>& data, uint8_t digest_bytes) {
  std::vector<uint8_t> result(digest_bytes);
  blake2s({key.data(), static_cast<uint8_t>(key.size()), data.data(), static_cast<uint16_t>(data.size())},
          result.data(), digest_bytes);
  return hex(result);
}

// RFC 7693, appendix E: data that follows a simple recurrence.
std::vector<uint8_t> recurrence(size_t count, uint32_t seed) {
  uint32_t a = 0xDEAD4BAD * seed, b = 1;
  std::vector<uint8_t> bytes(count);
  for (uint8_t& byte : bytes) {
    const uint32_t sum = a + b;
    a = b;
    b = sum;
    byte = static_cast<uint8_t>(sum >> 24);
  }
  return bytes;
}

}  // namespace

TEST_CASE("RFC 7693, appendix B: abc") {
  CHECK(digest({}, {'a', 'b', 'c'}, 32) == "508c5e8c327c14e2e1a72ba34eeb452f37458b209ed63a294d999b4c86675982");
}

TEST_CASE("RFC 7693, appendix E: all lengths of digest and message, with and without key") {
  std::vector<uint8_t> all;
  for (const uint8_t digest_bytes : {uint8_t{16}, uint8_t{20}, uint8_t{28}, uint8_t{32}}) {
    for (const size_t count : {0, 3, 64, 65, 255, 1024}) {
      const auto data = recurrence(count, static_cast<uint32_t>(count));
      const auto key = recurrence(digest_bytes, digest_bytes);
      for (const bool has_key : {false, true}) {
        std::vector<uint8_t> part(digest_bytes);
        blake2s({key.data(), has_key ? digest_bytes : uint8_t{0}, data.data(), static_cast<uint16_t>(count)},
                part.data(), digest_bytes);
        all.insert(all.end(), part.begin(), part.end());
      }
    }
  }
  CHECK(digest({}, all, 32) == "6a411f08ce25adcdfb02aba641451cec53c598b24f4fc787fbdc88797f4c1dfe");
}

TEST_CASE("keyed vectors of the reference implementation") {
  CHECK(digest(counting(32), {}, 32) == "48a8997da407876b3d79c0d92325ad3b89cbb754d86ab71aee047ad345fd2c49");
  CHECK(digest(counting(32), counting(64), 32) ==
        "8975b0577fd35566d750b362b0897a26c399136df07bababbde6203ff2954ed4");
}

TEST_CASE("the tag is a digest of its own length, not a cut one") {
  CHECK(digest(counting(16), {'b', 'u', 'n', 'r', 'a', 'k', 'u'}, 8) == "3d4c911b31bfa707");
  CHECK(digest(counting(16), {'b', 'u', 'n', 'r', 'a', 'k', 'u'}, 32).substr(0, 16) != "3d4c911b31bfa707");
}

TEST_CASE("tags are compared whole") {
  uint8_t one[8] = {1, 2, 3, 4, 5, 6, 7, 8}, other[8] = {1, 2, 3, 4, 5, 6, 7, 8};
  CHECK(is_same_tag(one, other, 8));
  for (uint8_t i = 0; i < 8; ++i) {
    other[i] ^= 0x80;
    CHECK_FALSE(is_same_tag(one, other, 8));
    other[i] ^= 0x80;
  }
}
