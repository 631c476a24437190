// The wearable's flash store: records that survive power-off, until someone erases them or a write fails.
#pragma once

#include <stddef.h>

#include <map>
#include <vector>

#include "ports.h"
#include "virtual_clock.h"

namespace bunraku {

class FlashModel : public FlashStore {
 public:
  explicit FlashModel(VirtualClock& clock) : clock_(clock) {}

  bool load(uint8_t slot, uint8_t* data, uint16_t count) override;
  bool save(uint8_t slot, const uint8_t* data, uint16_t count) override;

  // The world's side. An image is slot (1 byte), length (2 bytes, little-endian), bytes; again and again.
  std::vector<uint8_t> image() const;
  bool use_image(const uint8_t* data, size_t count);  // false, and nothing is changed: no image
  void erase() { records_.clear(); }                  // as an upload of new firmware does

  bool fails = false;       // saves are refused and leave the record as it was
  bool tears_next = false;  // the power goes in the middle of the next save: half new, half erased
  uint32_t saves = 0;

 private:
  VirtualClock& clock_;
  std::map<uint8_t, std::vector<uint8_t>> records_;
};

}  // namespace bunraku
