// Discharge of a LiPo cell at a small load, as straight pieces; after that a running mean.
#include "battery.h"

#include "wire.h"

namespace bunraku {
namespace {

constexpr uint8_t kLowPercent = 15, kLowNoMorePercent = 20;

// A single 3.7 V cell at about 0.1 C and room temperature.
constexpr struct {
  uint16_t millivolts;
  uint8_t percent;
} kDischarge[] = {{3300, 0},  {3600, 5},  {3680, 10}, {3740, 20}, {3780, 30}, {3820, 42},
                  {3870, 55}, {3950, 70}, {4050, 85}, {4110, 92}, {4180, 100}};

}  // namespace

void Battery::measure(uint16_t millivolts) {
  if (millivolts == 0 || smoothed_ == 0)
    smoothed_ = static_cast<uint32_t>(millivolts) * kSmoothing;
  else
    smoothed_ = smoothed_ - smoothed_ / kSmoothing + millivolts;
  const uint8_t left = percent();
  is_low_ = left < (is_low_ ? kLowNoMorePercent : kLowPercent);
}

uint8_t Battery::percent() const {
  const uint16_t now = millivolts();
  if (now == 0) return wire::kBatteryUnknown;
  if (now <= kDischarge[0].millivolts) return 0;
  const auto* below = kDischarge;
  for (const auto& point : kDischarge) {
    if (now < point.millivolts) {
      const uint32_t rise = static_cast<uint32_t>(now - below->millivolts) * (point.percent - below->percent);
      return static_cast<uint8_t>(below->percent + rise / (point.millivolts - below->millivolts));
    }
    below = &point;
  }
  return 100;
}

}  // namespace bunraku
