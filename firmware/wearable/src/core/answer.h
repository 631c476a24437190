// One line of text that is being written, without its end.
#pragma once

#include <stdint.h>

namespace bunraku {

// Text that does not fit is cut off.
class Answer {
 public:
  static constexpr uint16_t kRoom = 280;  // its end, '\0', included

  void clear() { count_ = 0, text_[0] = '\0'; }
  Answer& add(const char* text);
  Answer& add_number(uint32_t value);
  Answer& add_hex(const uint8_t* bytes, uint8_t count);
  Answer& add_hex(uint32_t value);  // 8 digits
  const char* text() const { return text_; }
  uint16_t count() const { return count_; }

 private:
  char text_[kRoom] = "";
  uint16_t count_ = 0;
};

}  // namespace bunraku
