// The names of the faults, and what each of them sets.
#include "trouble.h"

#include <iterator>

namespace bunraku {
namespace {

constexpr const char* kFaultNames[] = {"nack",      "stuck bus",     "zero read", "torn read",   "flipped bit",
                                       "brown-out", "silent config", "frozen",    "fusion error"};
static_assert(std::size(kFaultNames) == kImuFaults, "a name for each fault, in the order of ImuFault");

struct Trouble {
  const char* name;
  void (*set)(World& world, double amount);
};
constexpr Trouble kTroubles[] = {
    {"loss", [](World& world, double share) { world.wifi.conditions.loss = share; }},
    {"send failures", [](World& world, double share) { world.wifi.conditions.send_failures = share; }},
    {"join failures", [](World& world, double share) { world.wifi.conditions.join_failures = share; }},
    {"dead radio", [](World& world, double is_so) { world.wifi.conditions.is_dead = is_so > 0; }},
    {"flash fails", [](World& world, double is_so) { world.flash.fails = is_so > 0; }},
    {"flash tears", [](World& world, double is_so) { world.flash.tears_next = is_so > 0; }},
    {"heading drift", [](World& world, double a_minute) { world.imu.drift_degrees_minute = a_minute; }},
    {"steel", [](World& world, double degrees) { world.imu.magnetic_disturbance_degrees = degrees; }},
    {"stretching", [](World& world, double us) { world.imu.stretch_us_byte = static_cast<uint32_t>(us); }},
};

bool find_fault(const std::string& name, ImuFault& fault) {
  for (size_t number = 0; number < kImuFaults; ++number) {
    if (name == kFaultNames[number]) {
      fault = static_cast<ImuFault>(number);
      return true;
    }
  }
  return false;
}

}  // namespace

bool find_chip(const std::string& name, Wired& wired) {
  constexpr const char* kChips[] = {"bno055", "bno085", "lsm6dsv"};
  for (size_t number = 0; number < std::size(kChips); ++number) {
    if (name != kChips[number]) continue;
    wired = static_cast<Wired>(number);
    return true;
  }
  return false;
}

bool inject(World& world, const std::string& name, uint32_t times) {
  ImuFault fault;
  if (!find_fault(name, fault)) return false;
  world.imu.inject(fault, times);
  return true;
}

bool set_trouble(World& world, const std::string& name, double amount) {
  for (const Trouble& trouble : kTroubles) {
    if (name == trouble.name) {
      trouble.set(world, amount);
      return true;
    }
  }
  ImuFault fault;  // its probability in each transaction on the bus
  if (!find_fault(name, fault)) return false;
  world.imu.set_probability(fault, amount);
  return true;
}

}  // namespace bunraku
