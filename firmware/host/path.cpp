// Evenly from waypoint to waypoint, the short way round.
#include "path.h"

#include <algorithm>
#include <cmath>

namespace bunraku {
namespace {

constexpr double kNearlyParallel = 0.9995;  // closer than this, a straight line and the arc are the same

Quaternion between(const Quaternion& from, const Quaternion& to, double share) {
  double cosine = 0;
  for (size_t part = 0; part < 4; ++part) cosine += from[part] * to[part];
  const double sign = cosine < 0 ? -1 : 1;
  const double angle = std::acos(std::min(1.0, std::abs(cosine)));
  const bool is_near = std::abs(cosine) > kNearlyParallel;
  const double left = is_near ? 1 - share : std::sin((1 - share) * angle) / std::sin(angle);
  const double right = sign * (is_near ? share : std::sin(share * angle) / std::sin(angle));
  Quaternion mixed;
  double square = 0;
  for (size_t part = 0; part < 4; ++part) {
    mixed[part] = left * from[part] + right * to[part];
    square += mixed[part] * mixed[part];
  }
  for (double& part : mixed) part /= std::sqrt(square);
  return mixed;
}

}  // namespace

void Path::stand(const Quaternion& orientation) {
  waypoints_.clear();
  waypoints_.push_back({0, orientation});
}

void Path::go_to(const Quaternion& orientation, uint64_t at_us) {
  while (!waypoints_.empty() && waypoints_.back().at_us >= at_us) waypoints_.pop_back();
  if (waypoints_.size() >= kMostRemembered) waypoints_.pop_front();
  waypoints_.push_back({at_us, orientation});
}

Quaternion Path::at(uint64_t at_us) const {
  const auto right = std::upper_bound(waypoints_.begin(), waypoints_.end(), at_us,
                                      [](uint64_t time, const Waypoint& point) { return time < point.at_us; });
  if (right == waypoints_.begin()) return waypoints_.front().orientation;
  if (right == waypoints_.end()) return waypoints_.back().orientation;
  const auto left = right - 1;
  const double share = static_cast<double>(at_us - left->at_us) / static_cast<double>(right->at_us - left->at_us);
  return between(left->orientation, right->orientation, share);
}

}  // namespace bunraku
