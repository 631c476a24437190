// The flash store in the ESP32's non-volatile storage, which bears power cuts and wear by itself.
#pragma once

#include <Preferences.h>

#include "../../core/ports.h"

namespace bunraku {

class NvsStore final : public FlashStore {
 public:
  bool load(uint8_t slot, uint8_t* data, uint16_t count) override;
  bool save(uint8_t slot, const uint8_t* data, uint16_t count) override;

 private:
  bool is_open();

  Preferences preferences_;
  bool is_open_ = false;
};

}  // namespace bunraku
