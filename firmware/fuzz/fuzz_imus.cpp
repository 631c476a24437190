// Lets a sensor hub or a raw inertial chip say arbitrary bytes: a reading that is believed has unit length, and an
// acceleration is one that the chip can measure.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "any_imu.h"
#include "lsm6dsv_registers.h"
#include "sh2.h"

using namespace bunraku;

namespace {

void require(bool is_right) {
  if (!is_right) abort();
}

// Its first byte chooses the chip. A hub's cargoes are channel, length and bytes; an LSM6DSV's looks are how many words
// wait, and then the words. Behind the last byte nobody answers.
class SayingBus final : public I2cBus {
 public:
  SayingBus(const uint8_t* data, size_t count) : at_(data), end_(data + count) {
    is_hub_ = (next() & 1) == 0;
    address_ = is_hub_ ? sh2::kAddress : lsm6dsv::kAddress;
  }

  bool write(uint8_t address, uint8_t, const uint8_t*, uint8_t) override { return address == address_; }
  bool read(uint8_t address, uint8_t reg, uint8_t* data, uint8_t count) override {
    if (is_hub_ || address != address_ || at_ == end_) return false;
    for (uint8_t i = 0; i < count; ++i) data[i] = next();
    if (reg == lsm6dsv::kWhoAmI) data[0] = lsm6dsv::kIdentity;
    if (reg == lsm6dsv::kFifoStatus) data[1] &= 0x48;
    return true;
  }
  bool receive(uint8_t address, uint8_t* data, uint8_t count) override {
    if (!is_hub_ || address != address_ || at_ == end_) return false;
    if (left_ == 0) {
      channel_ = next();
      left_ = static_cast<uint16_t>(next() + sh2::kHeaderBytes);
    }
    const uint8_t header[sh2::kHeaderBytes] = {static_cast<uint8_t>(left_), static_cast<uint8_t>(left_ >> 8),
                                               channel_, 0};
    memcpy(data, header, sizeof header);
    for (uint8_t i = sh2::kHeaderBytes; i < count; ++i) data[i] = next();
    if (count > sh2::kHeaderBytes)
      left_ = static_cast<uint16_t>(left_ > count ? left_ - count + sh2::kHeaderBytes : 0);
    if (left_ <= sh2::kHeaderBytes) left_ = 0;
    return true;
  }
  void recover() override {}
  bool is_over() const { return at_ == end_; }

 private:
  uint8_t next() { return at_ == end_ ? uint8_t{0} : *at_++; }

  const uint8_t* at_;
  const uint8_t* end_;
  bool is_hub_ = false;
  uint8_t address_ = 0, channel_ = 0;
  uint16_t left_ = 0;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t count) {
  SayingBus bus(data, count);
  AnyImu any(bus);
  Imu& imu = any;
  uint32_t now_us = 0xFFFFFFFFu - 400000;  // the clock wraps on the way
  imu.start({Fusion::kImuPlus, 0x21, 0x04}, now_us);
  for (int turn = 0; turn < 4000 && !(bus.is_over() && turn > 2000); ++turn) {
    now_us += 1100;
    imu.step(now_us);
    Sample sample;
    if (turn % 8 == 0 && imu.sample(now_us, sample)) {
      float norm = 0;
      for (const int16_t part : sample.orientation) norm += static_cast<float>(part) * static_cast<float>(part);
      require(fabsf(sqrtf(norm) / 16384 - 1) < 0.02f);
    }
    int16_t linear[3];
    if (!imu.acceleration(linear)) continue;
    for (const int16_t part : linear) require(abs(int{part}) <= 10000);
  }
  return 0;
}
