// The flash store in the SAM D21's own flash: each slot a record that wanders over four rows.
#pragma once

#include "../../core/ports.h"
#include "page_log.h"

namespace bunraku {

class NvmStore final : public FlashStore, private FlashRows {
 public:
  bool load(uint8_t slot, uint8_t* data, uint16_t count) override;
  bool save(uint8_t slot, const uint8_t* data, uint16_t count) override;

 private:
  PageLog log_of(uint8_t slot);
  const uint8_t* row(uint8_t row) const override;
  void erase(uint8_t row) override;
  void program(uint8_t row, uint8_t page, const uint8_t (&data)[kPageBytes]) override;
};

}  // namespace bunraku
