// The BNO085 as its host sees it: cargoes, requests and answers, reports on time, restarts, and what goes wrong.
#pragma once

#include <deque>
#include <vector>

#include "imu_model.h"

namespace bunraku {

// Its faults: a zero read is a header or cargo of zeros; a torn read changes a byte, which no
// checksum of the bus would show; a silent config is a hub that has forgotten its reports; a frozen one reports no
// more but answers; one with a fusion error answers nothing until it is reset.
class Bno085Model final : public ImuModel {
 public:
  static constexpr uint64_t kStartUpUs = 100'000, kResetUs = 100'000;  // datasheet 6.5.3: 94 ms to the first cargo

  // Power comes now. `seed` makes its serial number, its noise and its faults.
  Bno085Model(VirtualClock& clock, uint64_t seed, uint8_t address = 0x4A);

  bool write(uint8_t address, uint8_t reg, const uint8_t* data, uint8_t count) override;
  bool read(uint8_t, uint8_t, uint8_t*, uint8_t) override { return false; }  // it has no registers
  bool receive(uint8_t address, uint8_t* data, uint8_t count) override;
  void power_on() override;

  Quaternion newest() override;
  Quaternion previous() override;
  Quaternion fused(uint64_t at_us, bool has_field) const;  // the truth that its fusion has
  uint32_t interval_us(uint8_t report) const { return features_[report].interval_us; }
  uint32_t saves() const { return saves_; }
  bool refuses_saves = false;
  bool is_shy = false;  // does not acknowledge a read while it has nothing to say

 private:
  static constexpr uint8_t kReports = 16;
  struct Cargo {
    uint8_t channel;
    std::vector<uint8_t> payload;
    uint64_t base_us = 0;  // time of its reports, written when the cargo leaves; 0: it has none
  };
  struct Feature {
    uint32_t interval_us = 0;
    uint64_t next_us = 0;
    uint8_t sequence = 0;
  };

  void settle() override;
  void strike_states() override;
  void start_up(uint64_t at_us);
  void restart(uint64_t us);
  void report(uint64_t at_us);
  void add(std::vector<uint8_t>& cargo, uint8_t which, uint64_t at_us);
  bool obey(uint8_t channel, const uint8_t* message, size_t count);
  bool set_feature(const uint8_t* message);
  void answer(const std::vector<uint8_t>& message) { waiting_.push_back({2, message}); }
  void answer_record(uint16_t record);
  uint8_t accuracy(uint8_t which, uint64_t at_us) const;

  std::array<Feature, kReports> features_{};
  std::deque<Cargo> waiting_;  // to be fetched by the host
  std::array<uint8_t, 6> sequence_{};
  size_t fetched_ = 0;  // bytes of the first cargo
  bool is_announced_ = false;  // its header was read
  bool is_up_ = false;
  bool is_frozen_ = false, is_dumb_ = false, has_forgotten_ = false;
  bool is_saved_ = false;  // in its flash: it survives power
  uint32_t saves_ = 0;
  uint64_t fusion_us_ = 0;
  double first_heading_ = 0;
  double turned_ = 0;
  Quaternion last_turned_{1, 0, 0, 0};
  Quaternion newest_{1, 0, 0, 0}, previous_{1, 0, 0, 0};
};

}  // namespace bunraku
