// Text without a library: words, numbers, hex.
#include "answer.h"

namespace bunraku {

Answer& Answer::add(const char* text) {
  while (*text != '\0' && count_ < sizeof text_ - 1) text_[count_++] = *text++;
  text_[count_] = '\0';
  return *this;
}

Answer& Answer::add_number(uint32_t value) {
  char digits[11];
  char* at = digits + sizeof digits - 1;
  *at = '\0';
  do {
    *--at = static_cast<char>('0' + value % 10);
    value /= 10;
  } while (value != 0);
  return add(at);
}

Answer& Answer::add_hex(const uint8_t* bytes, uint8_t count) {
  static constexpr char kDigits[] = "0123456789abcdef";
  for (uint8_t i = 0; i < count; ++i) {
    const char pair[3] = {kDigits[bytes[i] >> 4], kDigits[bytes[i] & 15], '\0'};
    add(pair);
  }
  return *this;
}

Answer& Answer::add_hex(uint32_t value) {
  const uint8_t bytes[4] = {static_cast<uint8_t>(value >> 24), static_cast<uint8_t>(value >> 16),
                            static_cast<uint8_t>(value >> 8), static_cast<uint8_t>(value)};
  return add_hex(bytes, sizeof bytes);
}

}  // namespace bunraku
