// The USB serial line: bytes both ways while a host has the port open, never waiting.
#pragma once

#include <algorithm>
#include <deque>

#include "ports.h"

namespace bunraku {

class SerialModel : public SerialPort {
 public:
  static constexpr size_t kRoom = 512;  // bytes on their way, each direction

  bool is_connected() override { return is_open_; }
  uint16_t read(uint8_t* data, uint16_t room) override { return move_out(to_board_, data, room); }
  uint16_t write(const uint8_t* data, uint16_t count) override {
    return is_open_ ? move_in(to_host_, data, count) : uint16_t{0};
  }

  // The host's side.
  void connect(bool is_open) {  // false: the cable is out; what was on it is gone
    is_open_ = is_open;
    to_board_.clear();
    to_host_.clear();
  }
  uint16_t put(const uint8_t* data, uint16_t count) {  // how much was taken
    return is_open_ ? move_in(to_board_, data, count) : uint16_t{0};
  }
  uint16_t take(uint8_t* data, uint16_t room) { return move_out(to_host_, data, room); }

 private:
  static uint16_t move_in(std::deque<uint8_t>& line, const uint8_t* data, uint16_t count) {
    const size_t taken = std::min<size_t>(count, kRoom - line.size());
    line.insert(line.end(), data, data + taken);
    return static_cast<uint16_t>(taken);
  }
  static uint16_t move_out(std::deque<uint8_t>& line, uint8_t* data, uint16_t room) {
    const size_t count = std::min<size_t>(room, line.size());
    std::copy_n(line.begin(), count, data);
    line.erase(line.begin(), line.begin() + static_cast<std::ptrdiff_t>(count));
    return static_cast<uint16_t>(count);
  }

  bool is_open_ = false;
  std::deque<uint8_t> to_board_, to_host_;
};

}  // namespace bunraku
