// The firmware's version, as the hello and the console say it.
#pragma once

#include <stdint.h>

namespace bunraku {

constexpr uint8_t kFirmwareMajor = 1, kFirmwareMinor = 0, kFirmwarePatch = 0;
constexpr char kFirmwareVersion[] = "1.0.0";

}  // namespace bunraku
