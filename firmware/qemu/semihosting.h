// What the emulated board says to the machine that runs it: text, an exit code (Arm semihosting).
#pragma once

#include <stdint.h>

void say(const char* text);
void say(uint32_t number);
[[noreturn]] void leave(int code);
