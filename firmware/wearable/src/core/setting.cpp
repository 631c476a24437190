// The rules for each setting.
#include "setting.h"

#include <string.h>

#include "line_parsing.h"

namespace bunraku {
namespace {

constexpr uint8_t kShortestPassword = 8;  // WPA2

bool set_device(const char* value, Settings& settings) {
  uint8_t bytes[4];
  if (!parse_hex(value, bytes, sizeof bytes)) return false;
  uint32_t device_id = 0;
  for (const uint8_t byte : bytes) device_id = device_id << 8 | byte;
  if (device_id == 0) return false;
  settings.device_id = device_id;
  return true;
}

bool set_key(const char* value, Settings& settings) {
  uint8_t key[wire::kKeyBytes];
  if (!parse_hex(value, key, sizeof key)) return false;
  memcpy(settings.key, key, sizeof key);
  settings.has_key = true;
  return true;
}

bool set_name(const char* value, Settings& settings) {
  if (!is_word(value, kLongestName)) return false;
  strcpy(settings.name, value);
  return true;
}

bool set_network(const char* value, Settings& settings) {
  if (strlen(value) > kLongestNetwork) return false;
  strcpy(settings.network, value);
  return true;
}

bool set_password(const char* value, Settings& settings) {
  const size_t length = strlen(value);
  if (length > kLongestPassword || (length > 0 && length < kShortestPassword)) return false;
  strcpy(settings.password, value);
  return true;
}

bool set_port(const char* value, Settings& settings) { return parse_port(value, settings.port); }

bool set_fusion(const char* value, Settings& settings) {
  const bool is_ndof = strcmp(value, fusion_name(Fusion::kNdof)) == 0;
  if (!is_ndof && strcmp(value, fusion_name(Fusion::kImuPlus)) != 0) return false;
  settings.imu.fusion = is_ndof ? Fusion::kNdof : Fusion::kImuPlus;
  return true;
}

bool set_crystal(const char* value, Settings& settings) {
  const bool is_there = strcmp(value, crystal_name(true)) == 0;
  if (!is_there && strcmp(value, crystal_name(false)) != 0) return false;
  settings.imu.has_crystal = is_there;
  return true;
}

bool set_axes(const char* value, Settings& settings) {
  uint8_t map, sign;
  if (!parse_hex(value, &map, 1, ' ') || !parse_hex(value + 3, &sign, 1)) return false;
  if (!is_axis_remap(map, sign)) return false;
  settings.imu.axis_map = map;
  settings.imu.axis_sign = sign;
  return true;
}

constexpr struct {
  const char* name;
  bool (*set)(const char* value, Settings& settings);
  const char* rule;
} kSettable[] = {{"device", set_device, "a device is 8 hex digits, not all 0"},
                 {"key", set_key, "a key is 32 hex digits"},
                 {"name", set_name, "a name is 1 to 24 printable characters without spaces"},
                 {"network", set_network, "a network's name has up to 32 bytes"},
                 {"password", set_password, "a password has 8 to 63 bytes, or none for an open network"},
                 {"port", set_port, "a port is 1 to 65535"},
                 {"fusion", set_fusion, "fusion is imuplus or ndof"},
                 {"crystal", set_crystal, "crystal is yes or no: a 32 kHz crystal beside the BNO055"},
                 {"axes", set_axes, "axes are a turn of the IMU's axes as two bytes, as in: 24 00"}};

}  // namespace

void change_setting(const char* what, Settings& settings, Answer& answer) {
  for (const auto& known : kSettable) {
    const char* value = rest_after(what, known.name);
    if (value == nullptr) continue;
    if (known.set(value, settings))
      answer.add("ok");
    else
      answer.add("error: ").add(known.rule).add("; nothing was changed");
    return;
  }
  refuse("setting", what, answer);
}

const char* fusion_name(Fusion fusion) { return fusion == Fusion::kNdof ? "ndof" : "imuplus"; }

const char* crystal_name(bool has_crystal) { return has_crystal ? "yes" : "no"; }

}  // namespace bunraku
