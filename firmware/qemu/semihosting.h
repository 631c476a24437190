// Output of the emulated board to its host: text, an exit code (Arm semihosting).
#pragma once

#include <stdint.h>

void say(const char* text);
void say(uint32_t number);
[[noreturn]] void leave(int code);
