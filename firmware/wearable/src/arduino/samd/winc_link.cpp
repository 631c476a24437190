// Wi-Fi and one UDP socket of the MKR1000, over WiFi101.
#include "../board.h"
#ifdef BUNRAKU_WINC

#include "winc_link.h"

#include <Arduino.h>

#include "../../core/line_parsing.h"

namespace bunraku {
namespace {

constexpr unsigned long kJoinMs = 10000;   // longest wait of begin(); its default is a minute
constexpr uint8_t kJoinsBeforeRestart = 3;  // then the Wi-Fi module is restarted: it can hang forever
constexpr unsigned long kDisconnectMs = 500;  // longest wait for its answer
constexpr uint8_t kUnsentBeforeReopening = 5;

}  // namespace

bool WincLink::is_up() { return is_started_ && !is_socket_lost_ && WiFi.status() == WL_CONNECTED; }

bool WincLink::join(const char* network, const char* password) {
  board_.feed_watchdog();
  const uint8_t before = WiFi.status();
  is_started_ = before != WL_NO_SHIELD;
  is_socket_lost_ = false;
  if (!is_started_) return false;
  board_.feed_watchdog();
  if (before == WL_CONNECTED) disconnect();
  WiFi.setTimeout(kJoinMs);
  const bool is_open = password[0] == '\0';
  const uint8_t status = is_open ? WiFi.begin(network) : WiFi.begin(network, password);
  board_.feed_watchdog();
  if (status != WL_CONNECTED) {
    if (++failed_joins_ >= kJoinsBeforeRestart) {
      failed_joins_ = 0;
      is_started_ = false;
      WiFi.end();
    } else if (status != WL_DISCONNECTED) {
      disconnect();  // it may be joining still
    }
    return false;
  }
  failed_joins_ = 0;
  ask_radio();
  WiFi.noLowPowerMode();  // power save would hold packets back for up to a beacon interval, 100 ms
  return true;
}

// RSSI() waits for the module, up to a second: only while joining, which blocks anyway.
void WincLink::ask_radio() {
  radio_ = Radio();
  const char* version = WiFi.firmwareVersion();
  if (version == nullptr || !parse_version(version, radio_.firmware)) return;
  const int32_t rssi_dbm = WiFi.RSSI();
  board_.feed_watchdog();
  if (rssi_dbm >= INT8_MIN && rssi_dbm < 0) radio_.rssi_dbm = static_cast<int8_t>(rssi_dbm);
}

void WincLink::leave() {
  if (is_started_) disconnect();
}

// The module tells later that it has left. A begin() before that would take it for its own failure.
void WincLink::disconnect() {
  udp_.stop();
  WiFi.disconnect();
  const unsigned long asked_ms = millis();
  while (WiFi.status() != WL_DISCONNECTED && millis() - asked_ms < kDisconnectMs) {
  }
}

bool WincLink::open(uint16_t port) {
  port_ = port;
  unsent_ = 0;
  udp_.stop();
  return udp_.begin(port) == 1;
}

// WiFi101 silently closes the socket when an empty packet comes in.
bool WincLink::send(const Address& to, const uint8_t* data, uint16_t count) {
  if (is_socket_lost_) return false;  // without one, endPacket() reads beside its table
  if (udp_.beginPacket(IPAddress(to.ip), to.port) != 1) return false;
  const bool is_sent = udp_.write(data, count) == count && udp_.endPacket() == 1;
  unsent_ = is_sent ? uint8_t{0} : static_cast<uint8_t>(unsent_ + 1);
  if (unsent_ >= kUnsentBeforeReopening) is_socket_lost_ = !open(port_);
  return is_sent;
}

// To the network's own broadcast address: the limited one (255.255.255.255) names no network.
bool WincLink::broadcast(uint16_t port, const uint8_t* data, uint16_t count) {
  const Address everyone{WiFi.localIP() | ~WiFi.subnetMask(), port};
  return send(everyone, data, count);
}

// The sender is asked before the bytes are read: reading them lets the next packet overwrite it.
uint16_t WincLink::receive(uint8_t* data, uint16_t room, Address& from) {
  const int size = udp_.parsePacket();
  if (size <= 0) return 0;
  const uint32_t ip = udp_.remoteIP();
  const uint16_t port = udp_.remotePort();
  const int count = udp_.read(data, room);
  if (count != size) return 0;  // longer than any packet of ours; the next call throws the rest away
  from = Address{ip, port};
  return static_cast<uint16_t>(count);
}

}  // namespace bunraku

#endif
