// Wi-Fi of an ESP32-S3 board, and one UDP socket of its lwIP: the core's WiFiUDP takes memory for each packet, and an
// empty one from anyone would close its ears.
#pragma once

#include "../../core/ports.h"

namespace bunraku {

class UdpLink final : public DatagramLink {
 public:
  explicit UdpLink(Board& board) : board_(board) {}
  bool is_up() override;
  bool join(const char* network, const char* password) override;
  void leave() override;
  bool open(uint16_t port) override;
  bool send(const Address& to, const uint8_t* data, uint16_t count) override;
  bool broadcast(uint16_t port, const uint8_t* data, uint16_t count) override;
  uint16_t receive(uint8_t* data, uint16_t room, Address& from) override;
  Radio radio() override { return radio_; }

 private:
  void close_socket();

  Board& board_;
  Radio radio_;
  int socket_ = -1;
  bool is_started_ = false;
};

}  // namespace bunraku
