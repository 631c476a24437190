// The flash store in the ESP32's non-volatile storage.
#include "../board.h"
#ifdef BUNRAKU_ESP32

#include "nvs_store.h"

namespace bunraku {
namespace {

constexpr char kNamespace[] = "bunraku";
constexpr const char* kSlots[] = {"settings", "profile", "boots", "other-boots"};
constexpr uint8_t kCount = sizeof kSlots / sizeof kSlots[0];

}  // namespace

bool NvsStore::load(uint8_t slot, uint8_t* data, uint16_t count) {
  if (slot >= kCount || !is_open() || !preferences_.isKey(kSlots[slot])) return false;
  if (preferences_.getBytesLength(kSlots[slot]) != count) return false;
  return preferences_.getBytes(kSlots[slot], data, count) == count;
}

bool NvsStore::save(uint8_t slot, const uint8_t* data, uint16_t count) {
  return slot < kCount && is_open() && preferences_.putBytes(kSlots[slot], data, count) == count;
}

bool NvsStore::is_open() {
  if (!is_open_) is_open_ = preferences_.begin(kNamespace, false);
  return is_open_;
}

}  // namespace bunraku

#endif
