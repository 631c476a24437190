// Wi-Fi and one UDP socket of the MKR WiFi 1010, over WiFiNINA. Which calls stop everything: ports.h.
#pragma once

#include <WiFiNINA.h>
#include <WiFiUdp.h>

#include "../../core/ports.h"

namespace bunraku {

class NinaLink final : public DatagramLink {
 public:
  explicit NinaLink(Board& board) : board_(board) {}
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
  unsigned long asked_ms_ = 0;  // when status() was last asked: it costs a conversation over SPI
  uint16_t port_ = 0;
  bool is_connected_ = false;   // by that answer
  bool is_started_ = false;
  uint8_t failed_joins_ = 0;
  uint8_t unsent_ = 0;  // in a row
};

}  // namespace bunraku
