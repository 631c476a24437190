// Calibration offsets of the BNO055 (registers 0x55 to 0x6A): what of them may be written back.
#pragma once

#include <stdint.h>

namespace bunraku {

// How many of the 22 bytes are sound: 22; 20 without the magnetometer's radius, which the chip often gives
// back as 0 and then refuses (error 9); 18 without both radii; 0: nonsense, write nothing.
uint8_t sound_profile_bytes(const uint8_t* offsets22);

}  // namespace bunraku
