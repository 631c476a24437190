// Whichever inertial unit is wired: the first of several drivers whose chip answers is the wearable's.
#pragma once

#include <stdint.h>

#include "imu.h"

namespace bunraku {

// Its chips must have different addresses. Without a found one each driver has its turn with the bus.
class ImuSearch final : public Imu {
 public:
  template <uint8_t kCount>
  explicit ImuSearch(Imu* const (&candidates)[kCount]) : candidates_(candidates), count_(kCount) {}

  void start(const ImuSettings& settings, uint32_t now_us) override;
  void step(uint32_t now_us) override;
  bool sample(uint32_t now_us, Sample& out) override { return is_found_ && imu().sample(now_us, out); }
  bool acceleration(int16_t (&linear)[3]) override { return is_found_ && imu().acceleration(linear); }

  bool is_running() const override { return is_found_ && imu().is_running(); }
  bool has_failed() const override;
  bool has_id() const override { return is_found_ && imu().has_id(); }
  const uint8_t* unique_id() const override { return imu().unique_id(); }

  bool use_profile(const uint8_t* profile22) override { return is_found_ && imu().use_profile(profile22); }
  void save_profile() override {
    if (is_found_) imu().save_profile();
  }
  bool profile_ready(uint8_t* profile22) override { return is_found_ && imu().profile_ready(profile22); }

  bool is_calibrated() const override { return is_found_ && imu().is_calibrated(); }
  bool has_profile() const override { return is_found_ && imu().has_profile(); }
  uint8_t recoveries() const override { return imu().recoveries(); }

 private:
  Imu& imu() const { return *candidates_[which_]; }

  Imu* const* candidates_;
  uint8_t count_;
  uint8_t which_ = 0;  // found, or having its turn
  bool is_found_ = false;
};

}  // namespace bunraku
