// Records in flash: version, content, CRC. A damaged record, or one with another layout, counts as never
// written.
#include "settings.h"

#include <string.h>

#include "framing.h"

namespace bunraku {
namespace {

enum Slot : uint8_t { kSettingsSlot, kProfileSlot, kCountSlot, kOtherCountSlot };

constexpr uint8_t kRecordVersion = 1;
constexpr uint8_t kCrystal = 0x80;  // beside the fusion mode, which has four bits: older records have it unset
constexpr uint8_t kEnvelopeBytes = 1 + kCrcBytes;
constexpr uint8_t kSettingsBytes =
    kLongestName + 4 + 1 + wire::kKeyBytes + kLongestNetwork + kLongestPassword + 2 + 3;
constexpr uint8_t kLargestRecord = 192;
static_assert(kSettingsBytes + kEnvelopeBytes <= kLargestRecord, "ports.h promises a slot of this size");

// The content of a slot, between its version and its CRC.
template <uint8_t kBytes>
class Record {
 public:
  uint8_t* content() { return bytes_ + 1; }

  bool load(FlashStore& flash, uint8_t slot) {
    if (!flash.load(slot, bytes_, sizeof bytes_) || bytes_[0] != kRecordVersion) return false;
    return memcmp(crc().bytes, bytes_ + 1 + kBytes, kCrcBytes) == 0;
  }
  bool save(FlashStore& flash, uint8_t slot) {
    bytes_[0] = kRecordVersion;
    memcpy(bytes_ + 1 + kBytes, crc().bytes, kCrcBytes);
    return flash.save(slot, bytes_, sizeof bytes_);
  }
  bool erase(FlashStore& flash, uint8_t slot) {
    memset(bytes_, 0, sizeof bytes_);
    return flash.save(slot, bytes_, sizeof bytes_);
  }

 private:
  struct Crc {
    uint8_t bytes[kCrcBytes];
  };
  Crc crc() const {
    const uint16_t value = crc16(bytes_, 1 + kBytes);
    return {{static_cast<uint8_t>(value), static_cast<uint8_t>(value >> 8)}};
  }

  uint8_t bytes_[kBytes + kEnvelopeBytes] = {};
};

using SettingsRecord = Record<kSettingsBytes>;
using ProfileRecord = Record<kImuIdBytes + kProfileBytes>;
using CountRecord = Record<4>;

void put_bytes(uint8_t*& at, const void* data, uint8_t count) {
  memcpy(at, data, count);
  at += count;
}
void get_bytes(const uint8_t*& at, void* data, uint8_t count) {
  memcpy(data, at, count);
  at += count;
}
void get_text(const uint8_t*& at, char* text, uint8_t longest) {
  get_bytes(at, text, longest);
  text[longest] = '\0';
}

uint32_t counted(FlashStore& flash, uint8_t slot) {
  CountRecord record;
  uint32_t count = 0;
  const uint8_t* at = record.content();
  if (record.load(flash, slot)) wire::get(at, count);
  return count;
}

}  // namespace

bool load_settings(FlashStore& flash, Settings& settings) {
  settings = Settings();
  SettingsRecord record;
  if (!record.load(flash, kSettingsSlot)) return false;
  const uint8_t* at = record.content();
  uint8_t has_key, fusion;
  get_text(at, settings.name, kLongestName);
  wire::get(at, settings.device_id);
  wire::get(at, has_key);
  get_bytes(at, settings.key, sizeof settings.key);
  get_text(at, settings.network, kLongestNetwork);
  get_text(at, settings.password, kLongestPassword);
  wire::get(at, settings.port);
  wire::get(at, fusion);
  wire::get(at, settings.imu.axis_map);
  wire::get(at, settings.imu.axis_sign);
  settings.has_key = has_key != 0;
  settings.imu.has_crystal = (fusion & kCrystal) != 0;
  fusion = static_cast<uint8_t>(fusion & ~kCrystal);
  settings.imu.fusion = fusion == static_cast<uint8_t>(Fusion::kNdof) ? Fusion::kNdof : Fusion::kImuPlus;
  return true;
}

bool save_settings(FlashStore& flash, const Settings& settings) {
  SettingsRecord record;
  uint8_t* at = record.content();
  put_bytes(at, settings.name, kLongestName);
  wire::put(at, settings.device_id);
  wire::put(at, static_cast<uint8_t>(settings.has_key));
  put_bytes(at, settings.key, sizeof settings.key);
  put_bytes(at, settings.network, kLongestNetwork);
  put_bytes(at, settings.password, kLongestPassword);
  wire::put(at, settings.port);
  const uint8_t crystal = settings.imu.has_crystal ? kCrystal : uint8_t{0};
  wire::put(at, static_cast<uint8_t>(static_cast<uint8_t>(settings.imu.fusion) | crystal));
  wire::put(at, settings.imu.axis_map);
  wire::put(at, settings.imu.axis_sign);
  return record.save(flash, kSettingsSlot);
}

bool load_profile(FlashStore& flash, const uint8_t* imu_id, uint8_t* offsets) {
  ProfileRecord record;
  if (!record.load(flash, kProfileSlot)) return false;
  if (memcmp(record.content(), imu_id, kImuIdBytes) != 0) return false;
  memcpy(offsets, record.content() + kImuIdBytes, kProfileBytes);
  return true;
}

bool save_profile(FlashStore& flash, const uint8_t* imu_id, const uint8_t* offsets) {
  ProfileRecord record;
  memcpy(record.content(), imu_id, kImuIdBytes);
  memcpy(record.content() + kImuIdBytes, offsets, kProfileBytes);
  return record.save(flash, kProfileSlot);
}

bool forget_all(FlashStore& flash) {
  const bool has_forgotten = SettingsRecord().erase(flash, kSettingsSlot);
  return ProfileRecord().erase(flash, kProfileSlot) && has_forgotten;
}

uint32_t count_boot(FlashStore& flash) {
  const uint32_t one = counted(flash, kCountSlot), other = counted(flash, kOtherCountSlot);
  const uint32_t boot = (one > other ? one : other) + 1;
  CountRecord record;
  uint8_t* at = record.content();
  wire::put(at, boot);
  const Slot older = one > other ? kOtherCountSlot : kCountSlot;
  if (!record.save(flash, older)) record.save(flash, one > other ? kCountSlot : kOtherCountSlot);  // worn out
  return boot;
}

}  // namespace bunraku
