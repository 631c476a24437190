// Patterns that a dancer can tell apart at arm's length, and that the stalls do not see while all is well.
#include "led_pattern.h"

namespace bunraku {
namespace {

constexpr uint32_t kFlashMs = 60, kFlashEveryMs = 250;
constexpr uint32_t kOnMs = 60, kOnEveryMs = 3000;
constexpr uint32_t kLowEveryMs = 4000, kLowLastsMs = 1000;

bool is_blinking(uint32_t now_ms, uint32_t period_ms) { return now_ms % period_ms < period_ms / 2; }

// `count` short flashes at the start of each period.
bool is_flashing(uint32_t now_ms, uint8_t count, uint32_t period_ms) {
  const uint32_t at_ms = now_ms % period_ms;
  return at_ms < count * kFlashEveryMs && at_ms % kFlashEveryMs < kFlashMs;
}

bool is_lit_as_asked(uint8_t box_led, uint32_t now_ms) {
  switch (box_led) {
    case wire::kLedOn: return now_ms % kOnEveryMs < kOnMs;
    case wire::kLedSlow: return is_blinking(now_ms, 1000);
    case wire::kLedFast: return is_blinking(now_ms, 200);
    default: return false;
  }
}

}  // namespace

bool is_lit(const LightCues& cues, uint32_t now_ms) {
  const bool is_linked = cues.state == State::kLinked;
  if (cues.is_saving) return true;
  if (cues.is_strobing || (is_linked && cues.box_led == wire::kLedStrobe)) return is_blinking(now_ms, 100);
  if (cues.state == State::kNotProvisioned) return is_flashing(now_ms, 2, 2000);
  if (cues.has_imu_failed) return is_flashing(now_ms, 5, 2500);
  const bool box_wants_attention = is_linked && (cues.box_led == wire::kLedSlow || cues.box_led == wire::kLedFast);
  if (cues.is_battery_low && !box_wants_attention && now_ms % kLowEveryMs < kLowLastsMs)
    return is_flashing(now_ms, 3, kLowEveryMs);
  if (is_linked) return is_lit_as_asked(cues.box_led, now_ms);
  return is_blinking(now_ms, cues.state == State::kJoining ? 200 : 1000);
}

}  // namespace bunraku
