// The real core on an emulated Cortex-M0: golden packets, provisioning by cable, pairing, ten seconds of dance in
// virtual time. Says what it found, counts instructions, and leaves with 0 if all is well.
#include <string.h>

#include "blake2s.h"
#include "bno055.h"
#include "golden.h"
#include "instructions.h"
#include "scripted_imu.h"
#include "semihosting.h"
#include "small_box.h"
#include "wearable.h"

using namespace bunraku;

namespace {

constexpr uint32_t kTurnUs = 1000;  // the loop turns a thousand times a second
constexpr uint32_t kSecond = 1000000, kDanceSeconds = 10;
constexpr uint32_t kDeviceId = 0x1A2B3C4D;
constexpr uint8_t kKey[wire::kKeyBytes] = {15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0};
constexpr char kProvisioning[] =
    "set device 1a2b3c4d\nset key 0f0e0d0c0b0a09080706050403020100\nset name left-wrist\n"
    "set network stage\nset password break-a-leg\nsave\n";
constexpr uint32_t kClockHz = 48000000, kCyclesPerInstruction = 2;  // 2: see docs/firmware.md
constexpr uint32_t kMostShare = 20;                                 // percent of the processor

Instructions core_work;  // counts while the core runs, not while a port does
uint32_t now_us = 0;

// In a port: the core's instructions are not counted until it returns.
struct Outside {
  Outside() { core_work.stop(); }
  ~Outside() { core_work.go(); }
};

class VirtualClock final : public Clock {
 public:
  uint32_t micros() override { return now_us; }
};

class CountedBus final : public I2cBus {
 public:
  bool write(uint8_t address, uint8_t reg, const uint8_t* data, uint8_t count) override {
    const Outside outside;
    return imu_.write(address, reg, data, count);
  }
  bool read(uint8_t address, uint8_t reg, uint8_t* data, uint8_t count) override {
    const Outside outside;
    return imu_.read(address, reg, data, count);
  }
  void recover() override {}

 private:
  ScriptedImu imu_{now_us};
};

class Air final : public DatagramLink {
 public:
  bool is_up() override { return is_up_; }
  bool join(const char* network, const char* password) override {
    return is_up_ = strcmp(network, "stage") == 0 && strcmp(password, "break-a-leg") == 0;
  }
  void leave() override { is_up_ = false; }
  bool open(uint16_t) override { return is_up_; }
  bool send(const Address&, const uint8_t* data, uint16_t count) override {
    const Outside outside;
    box.hear(data, count, now_us);
    return true;
  }
  bool broadcast(uint16_t, const uint8_t* data, uint16_t count) override { return send({}, data, count); }
  uint16_t receive(uint8_t* data, uint16_t room, Address& from) override {
    const Outside outside;
    if (!is_up_) return 0;
    if (in_flight_bytes_ == 0) {
      in_flight_bytes_ = box.answer(in_flight_, now_us);
      left_us_ = now_us;
    }
    const uint16_t count = in_flight_bytes_;
    if (count == 0 || count > room || now_us - left_us_ < kFlightUs) return 0;
    memcpy(data, in_flight_, count);
    in_flight_bytes_ = 0;
    from = {0x0104A8C0, 9750};
    return count;
  }

  SmallBox box{kDeviceId, kKey};

 private:
  static constexpr uint32_t kFlightUs = 3000;  // from the box to the wearable; the way there takes no time
  bool is_up_ = false;
  uint8_t in_flight_[wire::kLargest];
  uint8_t in_flight_bytes_ = 0;
  uint32_t left_us_ = 0;
};

class Cable final : public SerialPort {
 public:
  bool is_connected() override { return is_connected_; }
  uint16_t read(uint8_t* data, uint16_t room) override {
    uint16_t count = 0;
    while (count < room && *typed_ != '\0') data[count++] = static_cast<uint8_t>(*typed_++);
    return count;
  }
  uint16_t write(const uint8_t* data, uint16_t count) override {
    for (uint16_t i = 0; i < count; ++i) {
      memmove(heard_, heard_ + 1, sizeof heard_ - 2);
      heard_[sizeof heard_ - 2] = static_cast<char>(data[i]);
      if (memcmp(heard_, "ok saved", 8) == 0) is_saved = true;
    }
    return count;
  }
  void pull() { is_connected_ = false; }

  bool is_saved = false;

 private:
  bool is_connected_ = true;
  const char* typed_ = kProvisioning;
  char heard_[9] = "        ";
};

class Store final : public FlashStore {
 public:
  bool load(uint8_t slot, uint8_t* data, uint16_t count) override {
    if (slot >= kSlots || counts_[slot] != count) return false;
    memcpy(data, slots_[slot], count);
    return true;
  }
  bool save(uint8_t slot, const uint8_t* data, uint16_t count) override {
    if (slot >= kSlots || count > sizeof slots_[slot]) return false;
    memcpy(slots_[slot], data, count);
    counts_[slot] = count;
    return true;
  }

 private:
  static constexpr uint8_t kSlots = 4;
  uint8_t slots_[kSlots][248] = {};
  uint16_t counts_[kSlots] = {};
};

class Lamp final : public Led {
 public:
  void set(bool) override {}
};

class Microbit final : public Board {
 public:
  uint16_t battery_millivolts() override { return 3900; }
  void noise(uint8_t* data, uint8_t count) override { memset(data, 0xA5, count); }
  void feed_watchdog() override {}
  void restart() override {}
  uint32_t serial_number() override { return 0x12345678; }
};

VirtualClock virtual_clock;
CountedBus bus;
Air air;
Cable cable;
Store store;
Lamp lamp;
Microbit board;
Bno055 imu(bus);
Wearable wearable({virtual_clock, imu, air, cable, store, lamp, board});

void check(bool is_right, const char* what) {
  if (is_right) return;
  say("FAIL: "), say(what), say("\n");
  leave(1);
}

void check_golden_packets() {
  check(kGoldenHash == wire::kWireHash, "the golden packets are of another wire");
  for (const Golden& golden : kGolden) {
    uint8_t tag[wire::kTagBytes];
    const uint8_t signed_bytes = static_cast<uint8_t>(golden.count - sizeof tag);
    blake2s({kGoldenKey, sizeof kGoldenKey, golden.datagram, signed_bytes}, tag, sizeof tag);
    check(is_same_tag(tag, golden.datagram + signed_bytes, sizeof tag), golden.packet);
  }
}

void turn() {
  core_work.go();
  wearable.step();
  core_work.stop();
  now_us += kTurnUs - now_us % kTurnUs;
}

// A loop of known length, as a proof that instructions are what is counted: three a round.
void check_count() {
  constexpr uint32_t kRounds = 10000;
  Instructions proof;
  uint32_t left = kRounds;
  proof.go();
  asm volatile("1: sub %0, #1\n cmp %0, #0\n bne 1b" : "+l"(left) : : "cc");
  proof.stop();
  const uint64_t counted = proof.count();
  check(counted >= 3 * kRounds && counted < 3 * kRounds + 30, "instructions counted right");
}

// Runs until the condition holds or the time is over. Returns the milliseconds that it took.
template <typename Condition>
uint32_t turn_until(Condition is_so, uint32_t seconds, const char* what) {
  const uint32_t since_us = now_us;
  while (!is_so()) {
    check(now_us - since_us < seconds * kSecond, what);
    turn();
  }
  return (now_us - since_us) / 1000;
}

// Ten seconds: every reading, signed, new and in order, for a small share of the processor.
void dance(uint32_t rate_hz) {
  const uint32_t readings_before = air.box.readings;
  const uint64_t work_before = core_work.count();
  const uint32_t start_us = now_us;
  while (now_us - start_us < kDanceSeconds * kSecond) turn();
  const uint32_t readings = air.box.readings - readings_before;
  const uint32_t per_second = static_cast<uint32_t>((core_work.count() - work_before) / kDanceSeconds);
  const uint32_t permille = per_second / 1000 * kCyclesPerInstruction / (kClockHz / 1000000);

  say("dance: "), say(readings), say(" readings in "), say(kDanceSeconds), say(" s, ");
  say(air.box.lost), say(" lost, "), say(air.box.refused), say(" refused\n");
  say("round trip "), say(air.box.round_trip), say("00 us\n");
  say("instructions a second: "), say(per_second), say("; at "), say(kCyclesPerInstruction);
  say(" cycles each "), say(permille / 10), say("."), say(permille % 10), say(" % of 48 MHz\n");
  check(readings + 2 >= kDanceSeconds * rate_hz && readings <= kDanceSeconds * rate_hz + 2, "readings a second");
  check(air.box.lost == 0 && air.box.refused == 0, "every reading signed, new and in order");
  check(permille < kMostShare * 10, "less than 20 % of the processor");
}

}  // namespace

int main() {
  check_golden_packets();
  say("golden packets: tags right\n");
  Instructions::start_timer();
  check_count();
  wearable.begin();
  turn_until([] { return cable.is_saved; }, 5, "provisioning by cable");
  cable.pull();
  const uint32_t paired_ms = turn_until([] { return air.box.readings > 0; }, 10, "pairing and a first reading");
  say("provisioned, paired, first reading after "), say(paired_ms), say(" ms\n");

  dance(50);
  const uint32_t hellos = air.box.hellos;
  air.box.rate_hz = 100;
  air.box.is_silent = true;  // so that it says hello again
  turn_until([hellos] { return air.box.hellos > hellos; }, 10, "another hello to a silent box");
  air.box.is_silent = false;
  const uint32_t before = air.box.readings;
  turn_until([before] { return air.box.readings > before; }, 10, "the next assignment");
  dance(100);
  check(air.box.round_trip != wire::kRoundTripUnknown, "a round trip measured by the heartbeat");
  say("PASS\n");
  return 0;
}
