// A second, as clocks in the firmware count it.
#pragma once

#include <stdint.h>

namespace bunraku {

constexpr uint32_t kSecond = 1'000'000;  // microseconds

}  // namespace bunraku
