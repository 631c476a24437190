// Everything that can go wrong in the simulated world, by name.
#pragma once

#include <string>

#include "world.h"

namespace bunraku {

// The next `times` accesses to the IMU fail. False: there is no such fault.
bool inject(World& world, const std::string& fault, uint32_t times);

// Sets how bad something is. False: there is no such trouble.
bool set_trouble(World& world, const std::string& trouble, double amount);

}  // namespace bunraku
