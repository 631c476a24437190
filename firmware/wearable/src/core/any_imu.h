// Every inertial unit that the core drives, on one bus: the one that is wired is found.
#pragma once

#include "bno055.h"
#include "bno085.h"
#include "imu_search.h"
#include "lsm6dsv.h"

namespace bunraku {

class AnyImu final {
 public:
  explicit AnyImu(I2cBus& bus) : bno055_(bus), bno085_(bus), lsm6dsv_(bus) {}
  operator Imu&() { return search_; }

 private:
  Bno055 bno055_;
  Bno085 bno085_;
  Lsm6dsv lsm6dsv_;
  Imu* all_[3] = {&bno055_, &bno085_, &lsm6dsv_};
  ImuSearch search_{all_};
};

}  // namespace bunraku
