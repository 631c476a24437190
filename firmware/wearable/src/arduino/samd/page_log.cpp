// One record in flash that survives a power cut at any moment and wears its rows evenly.
#include "page_log.h"

#include <string.h>

#include "../../core/framing.h"

namespace bunraku {
namespace {

constexpr uint16_t kHeadBytes = 8;

uint8_t pages_for(uint16_t count) {
  return static_cast<uint8_t>((kHeadBytes + count + kPageBytes - 1) / kPageBytes);
}

// The sequence is added to the CRC: without it a head of another save could precede the data.
uint16_t sum_of(uint32_t sequence, const uint8_t* data, uint16_t count) {
  uint8_t head[6];
  memcpy(head, &sequence, 4);
  memcpy(head + 4, &count, 2);
  return static_cast<uint16_t>(crc16(data, count) ^ crc16(head, sizeof head));
}

}  // namespace

bool PageLog::load(uint8_t* data, uint16_t count) const {
  Place place;
  if (!newest(place) || place.head.count != count) return false;
  memcpy(data, at(place.row, place.page) + kHeadBytes, count);
  return true;
}

bool PageLog::save(const uint8_t* data, uint16_t count) {
  if (count == 0 || kHeadBytes + count > kRowBytes) return false;
  Place next = {first_row_, 0, {1, count, 0}};
  Place before;
  const bool has_before = newest(before);
  if (has_before) {
    next.head.sequence = before.head.sequence + 1;
    next.row = before.row;
    next.page = static_cast<uint8_t>(before.page + pages_for(before.head.count));
    const bool fits = next.page + pages_for(count) <= kPagesPerRow;
    if (old_ == Old::kErased || !fits || !is_blank(next.row, next.page, pages_for(count))) {
      next.row = static_cast<uint8_t>(first_row_ + (before.row - first_row_ + 1) % rows_);
      next.page = 0;
    }
  }
  next.head.crc = sum_of(next.head.sequence, data, count);
  if (next.page == 0) flash_.erase(next.row);
  write(next, data);
  Head written;
  const bool is_saved = is_whole(next.row, next.page, written) && written.sequence == next.head.sequence;
  if (is_saved && has_before && old_ == Old::kErased) flash_.erase(before.row);
  return is_saved;
}

void PageLog::write(const Place& place, const uint8_t* data) {
  uint16_t done = 0;
  for (uint8_t i = 0; i < pages_for(place.head.count); ++i) {
    uint8_t bytes[kPageBytes];
    memset(bytes, 0xFF, sizeof bytes);
    const uint16_t from = i == 0 ? kHeadBytes : 0;
    const uint16_t left = static_cast<uint16_t>(place.head.count - done);
    const uint16_t room = static_cast<uint16_t>(kPageBytes - from);
    const uint16_t piece = left < room ? left : room;
    if (i == 0) memcpy(bytes, &place.head, kHeadBytes);
    memcpy(bytes + from, data + done, piece);
    flash_.program(place.row, static_cast<uint8_t>(place.page + i), bytes);
    done = static_cast<uint16_t>(done + piece);
  }
}

bool PageLog::newest(Place& place) const {
  bool found = false;
  for (uint8_t row = first_row_; row < first_row_ + rows_; ++row) {
    for (uint8_t page = 0; page < kPagesPerRow;) {
      Head head;
      if (!is_whole(row, page, head)) {
        ++page;
        continue;
      }
      if (!found || head.sequence > place.head.sequence) place = {row, page, head};
      found = true;
      page = static_cast<uint8_t>(page + pages_for(head.count));
    }
  }
  return found;
}

bool PageLog::is_whole(uint8_t row, uint8_t page, Head& head) const {
  static_assert(sizeof(Head) == kHeadBytes, "the head is laid out without gaps");
  memcpy(&head, at(row, page), sizeof head);
  if (head.count == 0 || page * kPageBytes + kHeadBytes + head.count > kRowBytes) return false;
  return head.crc == sum_of(head.sequence, at(row, page) + kHeadBytes, head.count);
}

bool PageLog::is_blank(uint8_t row, uint8_t page, uint8_t pages) const {
  const uint8_t* bytes = at(row, page);
  for (uint16_t i = 0; i < pages * kPageBytes; ++i) {
    if (bytes[i] != 0xFF) return false;
  }
  return true;
}

}  // namespace bunraku
