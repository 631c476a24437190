// Wi-Fi and one UDP socket of the MKR1000, over WiFi101. Which of its calls stop everything, and for how long: ports.h.
#pragma once

#include <WiFi101.h>
#include <WiFiUdp.h>

#include "../../core/ports.h"

namespace bunraku {

class WincLink final : public DatagramLink {
 public:
  explicit WincLink(Board& board) : board_(board) {}
  bool is_up() override;
  bool join(const char* network, const char* password) override;
  void leave() override;
  bool open(uint16_t port) override;
  bool send(const Address& to, const uint8_t* data, uint16_t count) override;
  bool broadcast(uint16_t port, const uint8_t* data, uint16_t count) override;
  uint16_t receive(uint8_t* data, uint16_t room, Address& from) override;
  Radio radio() override { return radio_; }

 private:
  void disconnect();
  void ask_radio();

  Board& board_;
  WiFiUDP udp_;
  Radio radio_;
  uint16_t port_ = 0;
  bool is_started_ = false;  // else even status() starts the module, which blocks for about a second
  bool is_socket_lost_ = false;  // closed by the driver and not to be had again: down until the next join
  uint8_t failed_joins_ = 0;
  uint8_t unsent_ = 0;  // in a row
};

}  // namespace bunraku
