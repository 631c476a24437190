// One record in flash that survives a power cut at any moment and wears its rows evenly: each save goes to the
// next free pages, the newest whole one counts. Knows no chip, so the tests cut its power everywhere.
#pragma once

#include <stdint.h>

namespace bunraku {

constexpr uint16_t kPageBytes = 64, kPagesPerRow = 4;  // SAM D21: a page is programmed, a row is erased
constexpr uint16_t kRowBytes = kPageBytes * kPagesPerRow;

class FlashRows {
 public:
  virtual const uint8_t* row(uint8_t row) const = 0;
  virtual void erase(uint8_t row) = 0;
  virtual void program(uint8_t row, uint8_t page, const uint8_t (&data)[kPageBytes]) = 0;

 protected:
  ~FlashRows() = default;
};

// The part of the previous record that a save leaves. Kept ones cost no wear; erased ones reveal no key or
// password.
enum class Old : uint8_t { kKept, kErased };

class PageLog {
 public:
  PageLog(FlashRows& flash, uint8_t first_row, uint8_t rows, Old old)
      : flash_(flash), first_row_(first_row), rows_(rows), old_(old) {}  // at least two rows

  bool load(uint8_t* data, uint16_t count) const;  // false: never written, or in another size
  bool save(const uint8_t* data, uint16_t count);  // up to 248 bytes; false: the flash did not take it

 private:
  // Before each record, in its first page.
  struct Head {
    uint32_t sequence;  // counts saves
    uint16_t count;
    uint16_t crc;  // over sequence, count and data
  };
  struct Place {
    uint8_t row, page;
    Head head;
  };

  bool newest(Place& place) const;
  void write(const Place& place, const uint8_t* data);
  bool is_whole(uint8_t row, uint8_t page, Head& head) const;
  bool is_blank(uint8_t row, uint8_t page, uint8_t pages) const;
  const uint8_t* at(uint8_t row, uint8_t page) const { return flash_.row(row) + page * kPageBytes; }

  FlashRows& flash_;
  const uint8_t first_row_, rows_;
  const Old old_;
};

}  // namespace bunraku
