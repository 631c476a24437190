// The record in flash: it survives a power cut at any moment, and wears its rows evenly.
#include <doctest/doctest.h>

#include <string.h>

#include <algorithm>
#include <vector>

#include "page_log.h"

using namespace bunraku;

namespace {

// Flash as the chip has it: erasing sets bits, programming only clears them. The power can go in the middle.
class FlashInMemory : public FlashRows {
 public:
  explicit FlashInMemory(uint8_t rows) : erasures(rows), bytes_(rows * kRowBytes, 0) {}

  const uint8_t* row(uint8_t row) const override { return bytes_.data() + row * kRowBytes; }
  void erase(uint8_t row) override {
    change(row * kRowBytes, std::vector<uint8_t>(kRowBytes, 0xFF));
    ++erasures[row];
  }
  void program(uint8_t row, uint8_t page, const uint8_t (&data)[kPageBytes]) override {
    const size_t start = row * kRowBytes + page * kPageBytes;
    std::vector<uint8_t> after(data, data + kPageBytes);
    for (size_t i = 0; i < kPageBytes; ++i) after[i] &= bytes_[start + i];
    change(start, after);
  }

  bool holds(const std::vector<uint8_t>& bytes) const {
    return std::search(bytes_.begin(), bytes_.end(), bytes.begin(), bytes.begin() + 8) != bytes_.end();
  }

  std::vector<unsigned> erasures;
  int steps_until_power_cut = -1;  // half of that step is done, nothing after it

 private:
  void change(size_t start, const std::vector<uint8_t>& after) {
    if (steps_until_power_cut == 0) return;
    const bool is_cut = steps_until_power_cut == 1;
    if (steps_until_power_cut > 0) --steps_until_power_cut;
    std::copy_n(after.begin(), is_cut ? after.size() / 2 : after.size(),
                bytes_.begin() + static_cast<long>(start));
  }

  std::vector<uint8_t> bytes_;
};

std::vector<uint8_t> record(uint8_t seed, size_t count) {
  std::vector<uint8_t> bytes(count);
  uint32_t state = seed;
  for (uint8_t& byte : bytes) {
    state = state * 1664525u + 1013904223u;
    byte = static_cast<uint8_t>(state >> 24);
  }
  return bytes;
}

bool save(PageLog& log, const std::vector<uint8_t>& bytes) {
  return log.save(bytes.data(), static_cast<uint16_t>(bytes.size()));
}

std::vector<uint8_t> loaded(const PageLog& log, size_t count) {
  std::vector<uint8_t> bytes(count);
  return log.load(bytes.data(), static_cast<uint16_t>(count)) ? bytes : std::vector<uint8_t>{};
}

}  // namespace

TEST_CASE("flash that was never written holds nothing, whether erased or zero") {
  FlashInMemory flash(4);
  const PageLog log(flash, 0, 4, Old::kKept);
  CHECK(loaded(log, 4).empty());
  for (uint8_t row = 0; row < 4; ++row) flash.erase(row);
  CHECK(loaded(log, 4).empty());
}

TEST_CASE("the newest record counts, in its own size alone") {
  FlashInMemory flash(4);
  PageLog log(flash, 0, 4, Old::kKept);
  for (uint8_t i = 0; i < 40; ++i) {
    REQUIRE(save(log, record(i, 100)));
    CHECK(loaded(log, 100) == record(i, 100));
  }
  CHECK(loaded(log, 99).empty());
  REQUIRE(save(log, record(9, 4)));
  CHECK(loaded(log, 4) == record(9, 4));
  CHECK(loaded(log, 100).empty());
}

TEST_CASE("a record fills a row at most") {
  FlashInMemory flash(4);
  PageLog log(flash, 0, 4, Old::kKept);
  CHECK(save(log, record(1, 248)));
  CHECK(loaded(log, 248) == record(1, 248));
  CHECK_FALSE(save(log, record(2, 249)));
  CHECK_FALSE(save(log, {}));
  CHECK(loaded(log, 248) == record(1, 248));
}

TEST_CASE("neighbours in the same flash do not touch each other") {
  FlashInMemory flash(8);
  PageLog one(flash, 0, 4, Old::kKept), other(flash, 4, 4, Old::kErased);
  for (uint8_t i = 0; i < 30; ++i) {
    REQUIRE(save(one, record(i, 20)));
    REQUIRE(save(other, record(static_cast<uint8_t>(200 - i), 160)));
    CHECK(loaded(one, 20) == record(i, 20));
  }
  CHECK(loaded(other, 160) == record(171, 160));
}

TEST_CASE("wear is spread: a counter of 1600 saves erases no row more than 100 times") {
  FlashInMemory flash(4);
  PageLog log(flash, 0, 4, Old::kKept);
  for (unsigned i = 0; i < 1600; ++i) REQUIRE(save(log, record(static_cast<uint8_t>(i), 8)));
  CHECK(*std::max_element(flash.erasures.begin(), flash.erasures.end()) <= 100);
}

TEST_CASE("a power cut in any step of any save leaves the old record or the new one, and the next save works") {
  for (const Old policy : {Old::kKept, Old::kErased}) {
    for (const size_t size : {8u, 60u, 200u}) {
      for (uint8_t saved_before = 1; saved_before < 18; ++saved_before) {
        for (int cut = 1; cut <= 6; ++cut) {
          FlashInMemory flash(2);
          PageLog log(flash, 0, 2, policy);
          for (uint8_t i = 0; i < saved_before; ++i) REQUIRE(save(log, record(i, size)));
          const auto old = record(static_cast<uint8_t>(saved_before - 1), size), fresh = record(99, size);
          flash.steps_until_power_cut = cut;
          const bool is_saved = save(log, fresh);
          const auto found = loaded(log, size);
          CHECK((found == fresh || (!is_saved && found == old)));
          flash.steps_until_power_cut = -1;
          REQUIRE(save(log, record(123, size)));
          CHECK(loaded(log, size) == record(123, size));
        }
      }
    }
  }
}

TEST_CASE("a record that must go is nowhere in the flash once another one is saved") {
  for (const size_t size : {8u, 160u}) {
    FlashInMemory flash(4);
    PageLog log(flash, 0, 4, Old::kErased);
    for (uint8_t i = 0; i < 9; ++i) {
      REQUIRE(save(log, record(i, size)));
      if (i > 0) CHECK_FALSE(flash.holds(record(static_cast<uint8_t>(i - 1), size)));
      CHECK(flash.holds(record(i, size)));
    }
  }
}
