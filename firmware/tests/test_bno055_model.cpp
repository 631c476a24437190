// The simulated BNO055 against the datasheet: a model that forgives more would prove nothing.
#include <doctest/doctest.h>

#include <cmath>

#include "bno055_registers.h"
#include "imu_rig.h"

namespace bunraku {
namespace {

using namespace bno055;

constexpr uint8_t kAt = 0x28;

struct Bus {
  VirtualClock clock{0};
  Bno055Model model{clock, 7};

  bool put(uint8_t reg, uint8_t value) { return model.write(kAt, reg, &value, 1); }
  int get(uint8_t reg) {
    uint8_t value = 0;
    return model.read(kAt, reg, &value, 1) ? value : -1;
  }
  int16_t get16(uint8_t reg) {
    uint8_t bytes[2] = {};
    REQUIRE(model.read(kAt, reg, bytes, 2));
    return static_cast<int16_t>(bytes[0] | bytes[1] << 8);
  }
  Quaternion read_orientation() {
    uint8_t b[8] = {};
    REQUIRE(model.read(kAt, kQuaternion, b, 8));
    int16_t q[4];
    for (int i = 0; i < 4; ++i) q[i] = static_cast<int16_t>(b[2 * i] | b[2 * i + 1] << 8);
    return quaternion(q);
  }
  void started() { clock.advance(Bno055Model::kStartUpUs); }
  void fusing(Fusion fusion = Fusion::kImuPlus) {
    started();
    REQUIRE(put(kMode, static_cast<uint8_t>(fusion)));
    clock.advance(7000 + 20000);
  }
};

}  // namespace

TEST_CASE("nothing answers for 400 ms after power-on and 650 ms after a reset") {
  Bus bus;
  bus.clock.advance(399000);
  CHECK(bus.get(kChipId) == -1);
  CHECK(bus.model.counts().start_up_accesses == 1);
  bus.clock.advance(1000);
  CHECK(bus.get(kChipId) == 0xA0);
  CHECK(bus.put(kTrigger, kTriggerReset));
  bus.clock.advance(649000);
  CHECK(bus.get(kChipId) == -1);
  CHECK(bus.model.counts().early_accesses == 1);
  bus.clock.advance(1000);
  CHECK(bus.get(kChipId) == 0xA0);
  CHECK(bus.get(kUnits) == 0x80);
  CHECK(bus.get(kAxisMap) == 0x24);
  CHECK(bus.get16(0x69) == 480);
}

TEST_CASE("mode changes take 7 ms and 19 ms; an early write is counted and lost") {
  Bus bus;
  bus.started();
  bus.put(kMode, 0x08);
  bus.clock.advance(6000);
  CHECK(bus.get(kMode) == 0);
  CHECK(bus.model.counts().early_accesses == 1);
  bus.clock.advance(1000);
  CHECK(bus.get(kMode) == 0x08);
  CHECK(bus.get(kSystemStatus) == 5);
  bus.put(kMode, 0);
  bus.clock.advance(17000);
  bus.put(kUnits, 0);
  CHECK(bus.model.counts().early_accesses == 2);
  bus.clock.advance(2000);
  CHECK(bus.get(kUnits) == 0x80);
  CHECK(bus.get(kMode) == 0);
}

TEST_CASE("settings are taken in CONFIG mode only, read-only and reserved registers never") {
  Bus bus;
  bus.started();
  for (const int reg : {0x00, 0x20, 0x35, 0x39, 0x43, 0x6B}) {
    const uint32_t before = bus.model.counts().illegal_writes;
    bus.put(static_cast<uint8_t>(reg), 1);
    CHECK(bus.model.counts().illegal_writes == before + 1);
  }
  CHECK(bus.get(kChipId) == 0xA0);
  bus.put(kAxisMap, 0x25);  // x twice
  CHECK(bus.get(kAxisMap) == 0x24);
  bus.put(kMode, 0x08);
  bus.clock.advance(10000);
  const uint32_t before = bus.model.counts().illegal_writes;
  bus.put(kUnits, 0);
  bus.put(kMode, 0x0C);  // not from fusion to fusion
  CHECK(bus.model.counts().illegal_writes == before + 2);
  CHECK(bus.get(kUnits) == 0x80);
  CHECK(bus.get(kMode) == 0x08);
  CHECK(bus.get(kOffsets) == 0);
  CHECK(bus.model.counts().illegal_reads == 1);
}

TEST_CASE("page 1 holds the unique id") {
  Bus bus;
  bus.started();
  bus.put(kPageId, 1);
  CHECK(bus.get(kPage1UniqueId + 3) == bus.model.unique_id()[3]);
  CHECK(bus.get(kChipId) == 0);
  bus.put(kPageId, 0);
  CHECK(bus.get(kChipId) == 0xA0);
}

TEST_CASE("a byte takes 202.5 us, so that a quaternion takes 2.2 ms") {
  Bus bus;
  bus.fusing();
  const uint64_t begun_us = bus.clock.now_us();
  bus.read_orientation();
  CHECK(bus.clock.now_us() - begun_us == 2228);
}

TEST_CASE("IMUPLUS starts at heading 0 and drifts; NDOF knows north") {
  const Quaternion facing = turned(70, 0, 0, 1);
  SUBCASE("IMUPLUS") {
    Bus bus;
    bus.model.set_orientation(facing);
    bus.model.drift_degrees_minute = 6;
    bus.fusing();
    CHECK(degrees_between(bus.read_orientation(), {1, 0, 0, 0}) < 0.1);
    bus.clock.advance(60000000);
    CHECK(degrees_between(bus.read_orientation(), turned(6, 0, 0, 1)) < 0.1);
    CHECK(degrees_between(bus.read_orientation(), bus.model.newest()) < 0.1);
  }
  SUBCASE("NDOF") {
    Bus bus;
    bus.model.set_orientation(facing);
    bus.fusing(Fusion::kNdof);
    CHECK(degrees_between(bus.read_orientation(), facing) < 0.1);
    bus.model.magnetic_disturbance_degrees = 25;
    bus.clock.advance(20000);
    CHECK(degrees_between(bus.read_orientation(), turned(95, 0, 0, 1)) < 0.1);
  }
}

TEST_CASE("the outputs are zero in CONFIG mode and until the first update") {
  Bus bus;
  bus.started();
  CHECK(bus.get16(kQuaternion) == 0);
  bus.put(kMode, 0x08);
  bus.clock.advance(8000);
  CHECK(bus.get16(kQuaternion) == 0);
  bus.clock.advance(10000);
  CHECK(bus.get16(kQuaternion) == 16384);
  CHECK(bus.get16(kGravity + 4) == 981);
  CHECK(bus.get(kTemperature) == 27);
}

TEST_CASE("the remap says which axes are meant: gravity shows it") {
  Bus bus;
  bus.started();
  bus.put(kAxisMap, 0x09);  // x from y, y from z, z from x
  bus.put(kMode, 0x08);
  bus.clock.advance(30000);
  CHECK(bus.get16(kGravity) == 0);
  CHECK(bus.get16(kGravity + 2) == 981);  // the chip's z is up, and it is called y now
  CHECK(bus.get16(kGravity + 4) == 0);
}

TEST_CASE("a knock shows in the linear acceleration") {
  Bus bus;
  bus.fusing();
  CHECK(std::abs(bus.get16(kLinearAcceleration + 4)) < 5);
  bus.model.tap(bus.clock.now_us(), 30);
  int hardest = 0;
  for (int i = 0; i < 30; ++i) {
    hardest = std::max<int>(hardest, bus.get16(kLinearAcceleration + 4));
    bus.clock.advance(1000);
  }
  CHECK(hardest > 2000);
  CHECK(std::abs(bus.get16(kLinearAcceleration + 4)) < 5);
}

TEST_CASE("calibration rises with time and motion; CONFIG mode shows what was learnt") {
  Bus bus;
  bus.model.set_motion(dance);
  bus.fusing();
  CHECK(bus.get(kCalibration) == 0);
  for (int i = 0; i < 500; ++i) {
    bus.clock.advance(10000);
    bus.get(kCalibration);
  }
  CHECK(bus.get(kCalibration) == 0x3C);
  bus.put(kMode, 0);
  bus.clock.advance(19000);
  CHECK(bus.get16(0x67) == 1000);
  CHECK(bus.get16(0x69) == 0);  // no magnetometer in IMUPLUS: the radius that must not be written back
}

TEST_CASE("a written magnetometer radius outside 144..1280 is refused: status 1, error 9") {
  for (const int radius : {0, 143, 144, 1280, 1281}) {
    CAPTURE(radius);
    Bus bus;
    bus.started();
    bus.put(0x69, static_cast<uint8_t>(radius));
    bus.put(0x6A, static_cast<uint8_t>(radius >> 8));
    bus.put(kMode, 0x08);
    bus.clock.advance(30000);
    const bool is_valid = radius >= 144 && radius <= 1280;
    CHECK(bus.get(kSystemStatus) == (is_valid ? 5 : 1));
    CHECK(bus.get(kSystemError) == (is_valid ? 0 : 9));
    CHECK((bus.get16(kQuaternion) != 0) == is_valid);
  }
}

TEST_CASE("every fault does what its name says") {
  Bus bus;
  bus.model.set_motion(dance);
  bus.fusing();
  bus.clock.advance(300000);
  SUBCASE("NACK") {
    bus.model.inject(ImuFault::kNack);
    CHECK(bus.get(kChipId) == -1);
    CHECK(bus.get(kChipId) == 0xA0);
  }
  SUBCASE("stuck bus") {
    bus.model.inject(ImuFault::kStuckBus);
    for (int i = 0; i < 5; ++i) CHECK(bus.get(kChipId) == -1);
    bus.model.recover();
    CHECK(bus.get(kChipId) == 0xA0);
  }
  SUBCASE("zero read") {
    bus.model.inject(ImuFault::kZeroRead);
    CHECK(bus.read_orientation() == Quaternion{0, 0, 0, 0});
    CHECK(bus.read_orientation() != Quaternion{0, 0, 0, 0});
  }
  SUBCASE("flipped bit") {
    bus.model.inject(ImuFault::kFlippedBit);
    bus.read_orientation();
    CHECK(bus.model.counts().injected[static_cast<size_t>(ImuFault::kFlippedBit)] == 1);
    bus.model.inject(ImuFault::kFlippedBit);
    const Quaternion newest = bus.model.newest(), read = bus.read_orientation();
    int flipped = 0;
    for (size_t i = 0; i < 4; ++i) flipped += std::abs(std::abs(newest[i] - read[i]) - 2) < 1e-9;
    CHECK(flipped == 1);
  }
  SUBCASE("torn read") {
    bus.model.inject(ImuFault::kTornRead);
    const Quaternion newest = bus.model.newest(), read = bus.read_orientation();
    CHECK(newest != read);
    CHECK(newest[3] == read[3]);
  }
  SUBCASE("brown-out") {
    bus.model.inject(ImuFault::kBrownOut);
    CHECK(bus.get(kChipId) == -1);
    bus.clock.advance(400000);
    CHECK(bus.get(kMode) == 0);
    CHECK(bus.get(kUnits) == 0x80);
  }
  SUBCASE("silent CONFIG mode") {
    bus.model.inject(ImuFault::kSilentConfig);
    CHECK(bus.get(kMode) == 0);
    CHECK(bus.get16(kQuaternion) == 0);
  }
  SUBCASE("frozen") {
    bus.model.inject(ImuFault::kFrozen);
    const Quaternion before = bus.read_orientation();
    bus.clock.advance(500000);
    CHECK(bus.read_orientation() == before);
    CHECK(bus.get(kSystemStatus) == 5);
  }
  SUBCASE("fusion error") {
    bus.model.inject(ImuFault::kFusionError);
    CHECK(bus.get(kSystemStatus) == 1);
  }
  SUBCASE("by chance, in the share that was asked for, and the same again from the same seed") {
    bus.model.set_probability(ImuFault::kNack, 0.1);
    for (int i = 0; i < 2000; ++i) bus.get(kChipId);
    const uint32_t nacks = bus.model.counts().injected[static_cast<size_t>(ImuFault::kNack)];
    CHECK(nacks > 150);
    CHECK(nacks < 250);
  }
}

}  // namespace bunraku
