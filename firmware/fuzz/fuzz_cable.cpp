// Feeds arbitrary bytes from the cable to the framing and the console. No answer tells the key or the
// password.
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "console.h"
#include "framing.h"

using namespace bunraku;

namespace {

constexpr char kKeyAsHex[] = "c0ffee00c0ffee01c0ffee02c0ffee03";
constexpr char kPassword[] = "break-a-leg-tonight";

void require(bool is_right) {
  if (!is_right) abort();
}

Settings provisioned() {
  Settings settings;
  settings.device_id = 0x1A2B3C4D;
  settings.has_key = true;
  const uint8_t key[wire::kKeyBytes] = {0xC0, 0xFF, 0xEE, 0, 0xC0, 0xFF, 0xEE, 1,
                                        0xC0, 0xFF, 0xEE, 2, 0xC0, 0xFF, 0xEE, 3};
  memcpy(settings.key, key, sizeof key);
  strcpy(settings.name, "left-wrist");
  strcpy(settings.network, "stage");
  strcpy(settings.password, kPassword);
  return settings;
}

void answer_line(Console& console, const char* line, bool knows_secrets) {
  require(strlen(line) > 0 && strlen(line) <= kLongestLine);
  Answer answer;
  answer.clear();
  console.execute(line, Status{}, 0x12345678, answer);
  require(strlen(answer.text()) == answer.count());
  require(strchr(answer.text(), '\n') == nullptr);
  if (knows_secrets) return;
  require(strstr(answer.text(), kKeyAsHex) == nullptr);
  require(strstr(answer.text(), kPassword) == nullptr);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t count) {
  // An input that contains a secret may read it back, say as a name.
  const bool knows_secrets = memmem(data, count, kPassword, strlen(kPassword)) != nullptr ||
                             memmem(data, count, kKeyAsHex, strlen(kKeyAsHex)) != nullptr;
  CableInput input;
  Console console;
  console.begin(provisioned());
  uint32_t now_us = 0;
  for (size_t i = 0; i < count; ++i) {
    now_us += 100;
    switch (input.feed(data[i], now_us)) {
      case CableInput::Found::kNothing: break;
      case CableInput::Found::kOverlongLine: break;
      case CableInput::Found::kPacket: {
        uint8_t out[kLongestFrame];
        require(input.packet_bytes() > 0 && input.packet_bytes() <= wire::kLargest);
        require(frame(input.packet(), input.packet_bytes(), out) <= sizeof out);
        break;
      }
      case CableInput::Found::kLine: answer_line(console, input.line(), knows_secrets); break;
    }
  }
  return 0;
}
