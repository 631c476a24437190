// Every inertial unit that the core drives, on one bus: the one that is wired is found.
#pragma once

#include "bno055.h"
#include "bno085.h"
#include "imu_search.h"

namespace bunraku {

class AnyImu final {
 public:
  explicit AnyImu(I2cBus& bus) : bno055_(bus), bno085_(bus) {}
  operator Imu&() { return search_; }

 private:
  Bno055 bno055_;
  Bno085 bno085_;
  Imu* all_[2] = {&bno055_, &bno085_};
  ImuSearch search_{all_};
};

}  // namespace bunraku
