// The BNO055 from power-on to fusion, and back there after trouble: one bus transaction a step.
#include <string.h>

#include "bno055.h"
#include "bno055_registers.h"
#include "imu_profile.h"
#include "saturating.h"

namespace bunraku {
namespace {

using namespace bno055;

constexpr uint8_t kAddresses = 0x28 ^ 0x29;      // the pin ADR chooses
constexpr uint32_t kSearchUs = 1400000;          // start-up and a second: longer, and the chip has failed
constexpr uint32_t kLookUs = 10000;              // between looks for a chip
constexpr uint32_t kFailedLookUs = 250000;       // and when it has failed
constexpr uint32_t kRetryUs = 5000;              // after a bus error
constexpr uint32_t kBackOffUs = 100000;          // before the first reset; twice as long before each next
constexpr uint8_t kRepairsBeforeReset = 2;
constexpr uint8_t kRepairsBeforeFailed = 6;
constexpr uint8_t kMostRepairs = 8;              // the wait grows no longer than 3.2 s
constexpr uint8_t kMostLooks = 50;               // at a mode, or for data: 0.5 s
constexpr uint8_t kMostDoubts = 3;               // at what contradicts us: a single read may be wrong
constexpr uint8_t kMostReadings = 5;             // of what must read the same twice

bool is_blank(const uint8_t* bytes, uint8_t count) {
  for (uint8_t i = 0; i < count; ++i) {
    if (bytes[i] != 0) return false;
  }
  return true;
}

}  // namespace

void Bno055::advance(uint32_t now_us) {
  const uint8_t misses = misses_;
  switch (state_) {
    case State::kSelectPage: select_page(now_us); break;
    case State::kIdentify: identify(now_us); break;
    case State::kInspect: inspect(); break;
    case State::kEnterConfig: enter_config(); break;
    case State::kReset: reset(now_us); break;
    case State::kSelectIdPage: select_id_page(); break;
    case State::kReadId: read_id(); break;
    case State::kLeaveIdPage: leave_id_page(); break;
    case State::kSettings: write_setting(); break;
    case State::kCheckSettings: check_settings(); break;
    case State::kWriteOffsets: write_offsets(); break;
    case State::kReadOffsets: read_offsets(); break;
    case State::kEnterFusion: enter_fusion(); break;
    case State::kCheckFusion: check_fusion(); break;
    case State::kAwaitData: await_data(now_us); break;
    case State::kOff:
    case State::kRunning: break;
  }
  if (misses_ > misses && state_ > State::kIdentify) pause(kRetryUs);
}

void Bno055::search(uint32_t now_us) {
  searching_us_ = now_us;
  misses_ = unusable_ = 0;
  unchanged_ = 0;
  pause_us_ = 0;
  go(State::kSelectPage);
}

// The board may have been restarted while page 1 was selected, or in the middle of a transaction.
void Bno055::select_page(uint32_t now_us) { write(kPageId, 0) ? go(State::kIdentify) : keep_looking(now_us); }

void Bno055::identify(uint32_t now_us) {
  uint8_t id = 0;
  if (read(kChipId, &id, 1) && id == kChipIdValue) return go(State::kInspect);
  keep_looking(now_us);
}

void Bno055::keep_looking(uint32_t now_us) {
  go(State::kSelectPage);
  if (is_cold_) {
    is_cold_ = false;
    return pause(kStartUpUs);
  }
  if (now_us - searching_us_ > kSearchUs) has_failed_ = true;
  if (!has_run_) address_ ^= kAddresses;
  pause(has_failed_ ? kFailedLookUs : kLookUs);
}

// A chip that fuses as told goes on: the board was restarted, or the bus was disturbed.
void Bno055::inspect() {
  uint8_t bytes[kAxisSign - kSystemStatus + 1];
  if (!read(kSystemStatus, bytes, sizeof bytes)) return;
  const uint8_t status = bytes[0], error = bytes[kSystemError - kSystemStatus];
  const uint8_t* units = bytes + (kUnits - kSystemStatus);
  is_fusion_kept_ =
      status == kStatusFusion && !is_crystal_new_ && is_as_told(units, static_cast<uint8_t>(settings_.fusion));
  if (is_fusion_kept_) return go(has_id_ ? State::kAwaitData : State::kSelectIdPage);
  if (++looks_ < kMostDoubts) return;
  if (status == kStatusError) return repair_fusion(error);
  if (is_fusion_expected_) {
    const bool is_in_config = (bytes[kMode - kSystemStatus] & kModeBits) == kConfigMode;
    count(*units == kUnitsAtPowerOn ? counts_.brown_outs
          : is_in_config            ? counts_.silent_configs
                                    : counts_.mode_refusals);
  }
  enter_config_for(Errand::kConfigure);
}

void Bno055::enter_config_for(Errand errand) {
  errand_ = errand;
  is_fusion_expected_ = is_fusion_kept_ = wants_save_ = false;
  if (errand == Errand::kConfigure || errand == Errand::kReset) has_profile_ = false;
  go(State::kEnterConfig);
}

void Bno055::enter_config() {
  if (!write(kMode, kConfigMode)) return;
  pause(kToConfigUs);
  setting_ = 0;
  switch (errand_) {
    case Errand::kConfigure: return go(has_id_ ? State::kSettings : State::kSelectIdPage);
    case Errand::kRestore: return go(State::kWriteOffsets);
    case Errand::kSave: return go(State::kReadOffsets);
    case Errand::kReset: return go(State::kReset);
  }
}

// The chip resets before it can acknowledge the whole write: the result means nothing.
void Bno055::reset(uint32_t now_us) {
  write(kTrigger, kTriggerReset);
  count(counts_.resets);
  search(now_us);
  pause(kResetUs);
}

void Bno055::select_id_page() {
  if (write(kPageId, 1)) go(State::kReadId);
}

void Bno055::read_id() {
  uint8_t id[kIdBytes];
  if (!read(kPage1UniqueId, id, kIdBytes)) return;
  const bool is_confirmed = looks_ > 0 && memcmp(id, seen_, kIdBytes) == 0 && !is_blank(id, kIdBytes);
  memcpy(seen_, id, kIdBytes);
  if (is_confirmed) memcpy(unique_id_, id, kIdBytes), has_id_ = true;
  if (is_confirmed || ++looks_ >= kMostReadings) go(State::kLeaveIdPage);
}

void Bno055::leave_id_page() {
  if (write(kPageId, 0)) go(is_fusion_kept_ ? State::kAwaitData : State::kSettings);
}

void Bno055::write_setting() {
  const struct {
    uint8_t reg, value;
  } settings[] = {{kUnits, kMetric},
                  {kPower, 0},
                  {kAxisMap, settings_.axis_map},
                  {kAxisSign, settings_.axis_sign},
                  {kTrigger, settings_.has_crystal ? kTriggerCrystal : uint8_t{0}}};
  if (!write(settings[setting_].reg, settings[setting_].value)) return;
  if (settings[setting_].value == kTriggerCrystal && settings[setting_].reg == kTrigger) pause(kCrystalUs);
  if (++setting_ == sizeof settings / sizeof settings[0]) go(State::kCheckSettings);
}

void Bno055::check_settings() {
  uint8_t bytes[kAxisSign - kUnits + 1];
  if (!read(kUnits, bytes, sizeof bytes)) return;
  if (is_as_told(bytes, kConfigMode)) {
    is_crystal_new_ = false;
    go(is_profile_known_ ? State::kWriteOffsets : State::kEnterFusion);
  } else if (++looks_ >= kMostDoubts) {
    repair(counts_.mode_refusals);
  }
}

void Bno055::write_offsets() {
  if (!write(kOffsets, profile_, sound_profile_bytes(profile_))) return;
  has_profile_ = true;
  wants_restore_ = false;
  go(State::kEnterFusion);
}

void Bno055::read_offsets() {
  uint8_t offsets[kOffsetBytes];
  if (!read(kOffsets, offsets, kOffsetBytes)) return;
  const bool is_confirmed = looks_ > 0 && memcmp(offsets, seen_, kOffsetBytes) == 0;
  memcpy(seen_, offsets, kOffsetBytes);
  if (!is_confirmed && ++looks_ < kMostReadings) return;
  if (is_confirmed && sound_profile_bytes(offsets) > 0) {
    memcpy(profile_, offsets, kOffsetBytes);
    is_profile_known_ = has_profile_ = is_profile_ready_ = true;
    wants_restore_ = false;
  } else {
    count(counts_.refused_profiles);
  }
  go(State::kEnterFusion);
}

void Bno055::enter_fusion() {
  if (!write(kMode, static_cast<uint8_t>(settings_.fusion))) return;
  pause(kToFusionUs);
  go(State::kCheckFusion);
}

void Bno055::check_fusion() {
  uint8_t bytes[kMode - kSystemStatus + 1];
  if (!read(kSystemStatus, bytes, sizeof bytes)) return;
  const uint8_t status = bytes[0], mode = bytes[kMode - kSystemStatus] & kModeBits;
  const bool is_in_mode = mode == static_cast<uint8_t>(settings_.fusion);
  if (is_in_mode && status == kStatusFusion) return go(State::kAwaitData);
  ++looks_;
  if (status == kStatusError && looks_ >= kMostDoubts) return repair_fusion(bytes[1]);
  if (looks_ >= (is_in_mode ? kMostLooks : kMostReadings)) return repair(counts_.mode_refusals);
  pause(kLookUs);
}

// The first output comes 10 ms after the mode; zeros until then.
void Bno055::await_data(uint32_t now_us) {
  uint8_t quaternion[8];
  if (!read(kQuaternion, quaternion, sizeof quaternion)) return;
  if (!is_blank(quaternion, sizeof quaternion)) return begin_running(now_us);
  if (++looks_ >= kMostLooks) return repair(counts_.frozen);
  pause(kLookUs);
}

void Bno055::begin_running(uint32_t now_us) {
  if (!is_fusion_kept_) {
    gate_.reset();
    calibration_ = calibrated_looks_ = 0;
    if (has_run_) ++recoveries_;
  } else if (!has_run_ && wants_restore_) {  // the board was restarted: the chip has its profile from before
    has_profile_ = true;
    wants_restore_ = false;
  }
  has_run_ = is_fusion_expected_ = is_suspicious_ = true;  // the first look at its health is due at once
  has_failed_ = is_cold_ = false;
  unusable_ = 0;
  unchanged_ = 0;
  running_us_ = checked_us_ = now_us;
  go(State::kRunning);
}

// Through CONFIG mode again; from the third time on by a reset, later and later.
void Bno055::repair(uint16_t& reason) {
  count(reason);
  if (repairs_ < kMostRepairs) ++repairs_;
  if (repairs_ >= kRepairsBeforeFailed) has_failed_ = true;
  if (repairs_ <= kRepairsBeforeReset) return enter_config_for(Errand::kConfigure);
  enter_config_for(Errand::kReset);
  pause(kBackOffUs << (repairs_ - kRepairsBeforeReset - 1));
}

void Bno055::repair_fusion(uint8_t error) {
  if (error == kErrorConfiguration && is_profile_known_) {  // rather without than not at all
    is_profile_known_ = wants_restore_ = false;
    count(counts_.refused_profiles);
  }
  if (repairs_ < kRepairsBeforeReset) repairs_ = kRepairsBeforeReset;
  repair(counts_.fusion_errors);
}

}  // namespace bunraku
