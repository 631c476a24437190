// The flash store in the SAM D21's own flash. A row bears 25,000 erasures; each of the two records that take turns
// in counting power-ons wanders a page at a time over four rows, so it wears out after 400,000 saves.
#include "../board.h"
#ifdef BUNRAKU_SAMD

#include "nvm_store.h"

#include <Arduino.h>

namespace bunraku {
namespace {

constexpr uint8_t kSlots = 4, kRowsPerSlot = 4;
constexpr uint8_t kFirstCounter = 2;  // slots before it hold settings and calibration: old ones must go

// Part of the image, so that the linker keeps everything else out of it.
__attribute__((used)) alignas(kRowBytes) const uint8_t rows[kSlots * kRowsPerSlot * kRowBytes] = {};

void command(uint32_t command, const volatile void* address) {
  while (!(NVMCTRL->INTFLAG.reg & NVMCTRL_INTFLAG_READY)) {
  }
  NVMCTRL->ADDR.reg = reinterpret_cast<uintptr_t>(address) / 2;  // the register counts half words
  NVMCTRL->CTRLA.reg = static_cast<uint16_t>(NVMCTRL_CTRLA_CMDEX_KEY | command);
  while (!(NVMCTRL->INTFLAG.reg & NVMCTRL_INTFLAG_READY)) {
  }
}

}  // namespace

bool NvmStore::load(uint8_t slot, uint8_t* data, uint16_t count) {
  return slot < kSlots && log_of(slot).load(data, count);
}

bool NvmStore::save(uint8_t slot, const uint8_t* data, uint16_t count) {
  return slot < kSlots && log_of(slot).save(data, count);
}

PageLog NvmStore::log_of(uint8_t slot) {
  const Old old = slot < kFirstCounter ? Old::kErased : Old::kKept;
  return PageLog(*this, static_cast<uint8_t>(slot * kRowsPerSlot), kRowsPerSlot, old);
}

const uint8_t* NvmStore::row(uint8_t row) const {
  const uint8_t* at = rows + row * kRowBytes;
  asm volatile("" : "+r"(at));  // the compiler must not believe that the array stays as it was built
  return at;
}

void NvmStore::erase(uint8_t row_number) {
  command(NVMCTRL_CTRLA_CMD_ER, row(row_number));
  command(NVMCTRL_CTRLA_CMD_INVALL, row(row_number));  // the cache still holds what was there
}

void NvmStore::program(uint8_t row_number, uint8_t page, const uint8_t (&data)[kPageBytes]) {
  const uint8_t* at = row(row_number) + page * kPageBytes;
  auto* words = reinterpret_cast<volatile uint32_t*>(const_cast<uint8_t*>(at));
  NVMCTRL->CTRLB.reg |= NVMCTRL_CTRLB_MANW;  // the page is written by command, not by its last word
  command(NVMCTRL_CTRLA_CMD_PBC, at);
  for (uint16_t i = 0; i < kPageBytes; i += 4) {
    uint32_t word;
    memcpy(&word, data + i, sizeof word);
    words[i / 4] = word;
  }
  command(NVMCTRL_CTRLA_CMD_WP, at);
  command(NVMCTRL_CTRLA_CMD_INVALL, at);
}

}  // namespace bunraku

#endif
