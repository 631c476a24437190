// The ports of a wearable as small fakes: what a test sets is what the core sees, what the core does is kept.
#pragma once

#include <stdint.h>

#include <algorithm>
#include <cstring>
#include <deque>
#include <map>
#include <string>
#include <vector>

#include "ports.h"

namespace bunraku {
namespace fakes {

using Bytes = std::vector<uint8_t>;

class FakeClock : public Clock {
 public:
  uint32_t micros() override { return now_us; }
  uint32_t now_us = 0;
};

// A BNO055 that is always ready: registers on two pages, a status that follows the mode, trembling readings.
class FakeImu : public I2cBus {
 public:
  FakeImu() {
    page(0)[0x00] = 0xA0;
    for (uint8_t i = 0; i < 16; ++i) page(1)[0x50 + i] = static_cast<uint8_t>(0x50 + i);
    set(0x20, 16384);
    for (uint8_t at = 0x55; at <= 0x5F; at = static_cast<uint8_t>(at + 2))
      set(at, static_cast<int16_t>(at - 0x50));
    set(0x67, 1000);
    set(0x69, 480);
  }

  bool write(uint8_t address, uint8_t reg, const uint8_t* data, uint8_t count) override {
    if (!is_there || address != 0x28) return false;
    if (reg == 0x07) {
      page_ = data[0];
      return true;
    }
    std::copy_n(data, count, page(page_) + reg);
    if (reg == 0x55) ++profiles_written;
    if (reg == 0x3D) page(0)[0x39] = data[0] == 0 ? 0 : 5;
    return true;
  }
  bool read(uint8_t address, uint8_t reg, uint8_t* data, uint8_t count) override {
    if (!is_there || address != 0x28) return false;
    set(0x22, static_cast<int16_t>(++trembling_ % 3));
    std::copy_n(page(page_) + reg, count, data);
    return true;
  }
  void recover() override {}

  void set(uint8_t reg, int16_t value) { memcpy(page(0) + reg, &value, sizeof value); }
  void calibrate(uint8_t calibration) { page(0)[0x35] = calibration; }
  void accelerate(int16_t x) { set(0x28, x); }
  uint8_t mode() { return page(0)[0x3D]; }
  uint8_t trigger() { return page(0)[0x3F]; }

  bool is_there = true;
  int profiles_written = 0;

 private:
  uint8_t* page(uint8_t which) { return registers_[which & 1]; }

  uint8_t registers_[2][256] = {};
  uint8_t page_ = 0;
  uint32_t trembling_ = 0;
};

struct FakeDatagram {
  Address address;
  bool is_broadcast;
  Bytes data;
};

class FakeWifi : public DatagramLink {
 public:
  explicit FakeWifi(FakeClock& clock) : clock_(clock) {}

  bool is_up() override { return is_joined; }
  bool join(const char* network, const char* password) override {
    ++joins;
    joined_as = std::string(network) + "/" + password;
    clock_.now_us += join_us;
    is_joined = is_there;
    return is_joined;
  }
  void leave() override {
    ++leaves;
    is_joined = is_open = false;
  }
  bool open(uint16_t port) override {
    own_port = port;
    return is_open = is_joined;
  }
  bool send(const Address& to, const uint8_t* data, uint16_t count) override {
    if (!is_open) return false;
    sent.push_back({to, false, Bytes(data, data + count)});
    return true;
  }
  bool broadcast(uint16_t port, const uint8_t* data, uint16_t count) override {
    if (!is_open) return false;
    sent.push_back({{0, port}, true, Bytes(data, data + count)});
    return true;
  }
  uint16_t receive(uint8_t* data, uint16_t room, Address& from) override {
    if (received.empty()) return 0;
    const FakeDatagram datagram = received.front();
    received.pop_front();
    const size_t count = std::min<size_t>(room, datagram.data.size());
    std::copy_n(datagram.data.begin(), count, data);
    from = datagram.address;
    return static_cast<uint16_t>(count);
  }

  Radio radio() override { return told; }

  bool is_there = true;  // the network
  Radio told;
  bool is_joined = false, is_open = false;
  uint32_t join_us = 1'000'000;
  int joins = 0, leaves = 0;
  uint16_t own_port = 0;
  std::string joined_as;
  std::deque<FakeDatagram> sent, received;

 private:
  FakeClock& clock_;
};

class FakeSerial : public SerialPort {
 public:
  bool is_connected() override { return is_open; }
  uint16_t read(uint8_t* data, uint16_t room) override {
    if (to_wearable.empty()) return 0;
    const size_t count = std::min<size_t>(room, to_wearable.size());
    std::copy_n(to_wearable.begin(), count, data);
    to_wearable.erase(to_wearable.begin(), to_wearable.begin() + static_cast<long>(count));
    return static_cast<uint16_t>(count);
  }
  uint16_t write(const uint8_t* data, uint16_t count) override {
    const uint16_t taken = std::min(count, room_to_host);
    to_host.insert(to_host.end(), data, data + taken);
    return taken;
  }

  bool is_open = false;
  uint16_t room_to_host = 64;  // in each call
  Bytes to_wearable, to_host;
};

class FakeFlash : public FlashStore {
 public:
  bool load(uint8_t slot, uint8_t* data, uint16_t count) override {
    const auto found = records.find(slot);
    if (found == records.end() || found->second.size() < count) return false;
    std::copy_n(found->second.begin(), count, data);
    return true;
  }
  bool save(uint8_t slot, const uint8_t* data, uint16_t count) override {
    ++saves;
    if (is_broken || slot == worn_out_slot) return false;
    records[slot] = Bytes(data, data + count);
    return true;
  }

  std::map<uint8_t, Bytes> records;
  bool is_broken = false;
  int worn_out_slot = -1;
  int saves = 0;
};

class FakeLed : public Led {
 public:
  void set(bool is_on) override { is_lit = is_on, ++changes; }
  bool is_lit = false;
  int changes = 0;
};

class FakeBoard : public Board {
 public:
  uint16_t battery_millivolts() override { return millivolts; }
  void noise(uint8_t* data, uint8_t count) override {
    for (uint8_t i = 0; i < count; ++i) {
      noise_ = noise_ * 1664525 + 1013904223;
      data[i] = is_noisy ? static_cast<uint8_t>(noise_ >> 24) : uint8_t{0};
    }
  }
  void feed_watchdog() override { ++feedings; }
  void restart() override { ++restarts; }
  bool was_reset_by_watchdog() override { return has_hung; }
  uint32_t serial_number() override { return 0xB0A2D001; }

  uint16_t millivolts = 4000;
  bool is_noisy = true;
  bool has_hung = false;
  int feedings = 0, restarts = 0;

 private:
  uint32_t noise_ = 1;
};

}  // namespace fakes
}  // namespace bunraku
