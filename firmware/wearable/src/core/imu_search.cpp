// The search: a chip is found when its driver has read its id.
#include "imu_search.h"

namespace bunraku {

void ImuSearch::start(const ImuSettings& settings, uint32_t now_us) {
  if (is_found_) return imu().start(settings, now_us);
  for (uint8_t i = 0; i < count_; ++i) candidates_[i]->start(settings, now_us);
}

void ImuSearch::step(uint32_t now_us) {
  if (is_found_) return imu().step(now_us);
  which_ = static_cast<uint8_t>((which_ + 1) % count_);
  imu().step(now_us);
  is_found_ = imu().has_id();
}

bool ImuSearch::has_failed() const {
  if (is_found_) return imu().has_failed();
  for (uint8_t i = 0; i < count_; ++i) {
    if (!candidates_[i]->has_failed()) return false;
  }
  return true;
}

}  // namespace bunraku
