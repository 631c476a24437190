// Where the hand goes: orientations in time, turned evenly from one to the next.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include <array>
#include <deque>

namespace bunraku {

using Quaternion = std::array<double, 4>;  // w, x, y, z, unit

class Path {
 public:
  void stand(const Quaternion& orientation);                 // from now on, until a waypoint comes
  void go_to(const Quaternion& orientation, uint64_t at_us);  // reached then; waypoints come in order of time
  Quaternion at(uint64_t at_us) const;                       // beyond the last waypoint: stays there

 private:
  struct Waypoint {
    uint64_t at_us;
    Quaternion orientation;
  };
  static constexpr size_t kMostRemembered = 4096;
  std::deque<Waypoint> waypoints_{{0, {1, 0, 0, 0}}};
};

}  // namespace bunraku
