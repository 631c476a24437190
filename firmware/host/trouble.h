// Everything that can go wrong in the simulated world, by name.
#pragma once

#include <string>

#include "world.h"

namespace bunraku {

// A fault of the IMU strikes so many times from now on. False: there is no such fault.
bool inject(World& world, const std::string& fault, uint32_t times);

// How bad something is until it is set anew. False: there is no such trouble.
bool set_trouble(World& world, const std::string& trouble, double amount);

}  // namespace bunraku
