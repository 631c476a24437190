// Records in memory, with the flash's slowness and its ways to fail.
#include "flash_model.h"

#include <algorithm>

namespace bunraku {
namespace {

constexpr uint64_t kSaveUs = 20'000;  // SAMD21: erase a row and write its pages, some rows a record
constexpr uint8_t kErased = 0xFF;

}  // namespace

bool FlashModel::load(uint8_t slot, uint8_t* data, uint16_t count) {
  const auto found = records_.find(slot);
  if (found == records_.end() || found->second.size() < count) return false;
  std::copy_n(found->second.begin(), count, data);
  return true;
}

bool FlashModel::save(uint8_t slot, const uint8_t* data, uint16_t count) {
  clock_.advance(kSaveUs);
  if (fails) return false;
  ++saves;
  std::vector<uint8_t> record(data, data + count);
  if (tears_next) std::fill(record.begin() + count / 2, record.end(), kErased);
  records_[slot] = record;
  const bool is_whole = !tears_next;
  tears_next = false;
  return is_whole;
}

std::vector<uint8_t> FlashModel::image() const {
  std::vector<uint8_t> bytes;
  for (const auto& [slot, record] : records_) {
    bytes.push_back(slot);
    bytes.push_back(static_cast<uint8_t>(record.size()));
    bytes.push_back(static_cast<uint8_t>(record.size() >> 8));
    bytes.insert(bytes.end(), record.begin(), record.end());
  }
  return bytes;
}

bool FlashModel::use_image(const uint8_t* data, size_t count) {
  std::map<uint8_t, std::vector<uint8_t>> records;
  for (size_t at = 0; at < count;) {
    if (count - at < 3) return false;
    const uint8_t slot = data[at];
    const size_t length = static_cast<size_t>(data[at + 1] | data[at + 2] << 8);
    at += 3;
    if (count - at < length) return false;
    records[slot] = std::vector<uint8_t>(data + at, data + at + length);
    at += length;
  }
  records_ = records;
  return true;
}

}  // namespace bunraku
