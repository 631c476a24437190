// A BNO055 small enough for the micro:bit: answers, switches modes, turns slowly about its z axis. Faults of
// a real one are simulated on the host.
#pragma once

#include "bno055_registers.h"
#include "ports.h"

namespace bunraku {

class ScriptedImu final : public I2cBus {
 public:
  explicit ScriptedImu(uint32_t& now_us) : now_us_(now_us) {}

  bool write(uint8_t address, uint8_t reg, const uint8_t* data, uint8_t count) override;
  bool read(uint8_t address, uint8_t reg, uint8_t* data, uint8_t count) override;
  void recover() override {}

 private:
  bool answers(uint8_t address, uint8_t count);
  void reset();
  void fuse();

  uint32_t& now_us_;
  uint8_t registers_[128] = {};
  bool is_alive_ = false;
  uint32_t alive_at_us_ = bno055::kStartUpUs;
};

}  // namespace bunraku
