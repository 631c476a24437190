// From reset to main() on the emulated micro:bit, without anyone's start-up code.
#include <stdint.h>
#include <string.h>

#include "semihosting.h"

extern "C" {
extern uint32_t first_data[], last_data[], data_in_flash[], first_bss[], last_bss[], top_of_stack[];
extern void (*first_constructor[])();
extern void (*last_constructor[])();
}

int main();

namespace {

// The linker's symbols are marks in memory, no arrays whose pointers could be subtracted.
size_t bytes_between(const void* first, const void* last) {
  return reinterpret_cast<uintptr_t>(last) - reinterpret_cast<uintptr_t>(first);
}

void start() {
  memcpy(first_data, data_in_flash, bytes_between(first_data, last_data));
  memset(first_bss, 0, bytes_between(first_bss, last_bss));
  for (auto constructor = first_constructor; constructor != last_constructor; ++constructor) (*constructor)();
  leave(main());
}

void fault() {
  say("FAIL: the processor took a fault\n");
  leave(2);
}

}  // namespace

extern "C" void reset() { start(); }

// Initial stack pointer, reset, NMI, hard fault; no interrupt is ever enabled.
__attribute__((section(".vectors"), used))
const void* const vectors[4] = {top_of_stack, reinterpret_cast<const void*>(reset),
                                reinterpret_cast<const void*>(fault), reinterpret_cast<const void*>(fault)};
