// Chance for the simulation: the same seed gives the same luck on every machine.
#pragma once

#include <stdint.h>

namespace bunraku {

class Random {
 public:
  explicit Random(uint64_t seed) : state_(seed) {}

  uint64_t next() {  // SplitMix64: Steele, Lea, Flood, "Fast splittable pseudorandom number generators", 2014
    uint64_t mixed = state_ += 0x9e3779b97f4a7c15u;
    mixed = (mixed ^ mixed >> 30) * 0xbf58476d1ce4e5b9u;
    mixed = (mixed ^ mixed >> 27) * 0x94d049bb133111ebu;
    return mixed ^ mixed >> 31;
  }
  double share() { return static_cast<double>(next() >> 11) * 0x1p-53; }  // 0 up to, but not, 1
  bool happens(double probability) { return probability > 0 && share() < probability; }
  uint64_t between(uint64_t least, uint64_t most) { return least + next() % (most - least + 1); }

 private:
  uint64_t state_;
};

}  // namespace bunraku
