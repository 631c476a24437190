// Counts instructions: under `-icount shift=6` QEMU's time goes on by 64 ns an instruction, and the system timer
// counts that time in steps of 62.5 ns (16 MHz).
#pragma once

#include <stdint.h>

class Instructions {
 public:
  static void start_timer() {
    reg(0xE000E014) = kLast;  // reload
    reg(0xE000E018) = 0;      // current: begins at the reload value
    reg(0xE000E010) = 5;      // processor clock, on
  }

  void go() { since_ = now(); }
  void stop() { ticks_ += (since_ - now()) & kLast; }  // the timer counts down; a span is shorter than a second
  uint64_t count() const { return ticks_ * 625 / 640; }

 private:
  static constexpr uint32_t kLast = 0xFFFFFF;
  static volatile uint32_t& reg(uintptr_t address) { return *reinterpret_cast<volatile uint32_t*>(address); }
  static uint32_t now() { return reg(0xE000E018); }

  uint32_t since_ = 0;
  uint64_t ticks_ = 0;
};
