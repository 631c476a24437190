// Output of the emulated board to its host (Arm semihosting, release 3).
#include "semihosting.h"

namespace {

constexpr uint32_t kWriteText = 0x04, kExitExtended = 0x20;
constexpr uint32_t kApplicationExit = 0x20026;

void call(uint32_t operation, const void* argument) {
  register uint32_t r0 asm("r0") = operation;
  register const void* r1 asm("r1") = argument;
  asm volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
}

}  // namespace

void say(const char* text) { call(kWriteText, text); }

void say(uint32_t number) {
  char digits[11] = {};
  char* at = digits + 10;
  do {
    *--at = static_cast<char>('0' + number % 10);
    number /= 10;
  } while (number != 0);
  say(at);
}

void leave(int code) {
  const uint32_t reason[2] = {kApplicationExit, static_cast<uint32_t>(code)};
  call(kExitExtended, reason);
  for (;;) {
  }
}
