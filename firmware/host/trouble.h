// Names of the simulated world: chips, and everything that can go wrong.
#pragma once

#include <string>

#include "world.h"

namespace bunraku {

// The chip of that name. False: there is none.
bool find_chip(const std::string& name, Wired& wired);

// The next `times` accesses to the IMU fail. False: there is no such fault.
bool inject(World& world, const std::string& fault, uint32_t times);

// Sets how bad something is. False: there is no such trouble.
bool set_trouble(World& world, const std::string& trouble, double amount);

}  // namespace bunraku
