// Wi-Fi and one UDP socket of the MKR WiFi 1010, over WiFiNINA.
#include "../board.h"
#ifdef BUNRAKU_NINA

#include <Arduino.h>

#include "../../core/line_parsing.h"
#include "nina_link.h"

namespace bunraku {
namespace {

constexpr unsigned long kJoinMs = 10000;
constexpr unsigned long kLookMs = 50;         // between looks whether it has joined
constexpr unsigned long kStatusEveryMs = 250;
constexpr unsigned long kDisconnectMs = 500;
constexpr uint8_t kJoinsBeforeRestart = 3;    // then the module is restarted: it can hang
constexpr uint8_t kUnsentBeforeReopening = 5;

}  // namespace

bool NinaLink::is_up() {
  if (!is_started_ || !is_connected_) return false;
  const unsigned long now_ms = millis();
  if (now_ms - asked_ms_ < kStatusEveryMs) return true;
  asked_ms_ = now_ms;
  return is_connected_ = WiFi.status() == WL_CONNECTED;
}

// begin() looks every five seconds whether it has joined, as long as its time-out allows: with none it returns at
// once, and the looks are ours.
bool NinaLink::join(const char* network, const char* password) {
  board_.feed_watchdog();
  is_connected_ = false;
  const uint8_t before = WiFi.status();
  is_started_ = before != WL_NO_SHIELD;
  if (!is_started_) return false;
  if (before == WL_CONNECTED) disconnect();
  WiFi.setTimeout(0);
  const unsigned long begun_ms = millis();
  password[0] == '\0' ? WiFi.begin(network) : WiFi.begin(network, password);
  while (WiFi.status() != WL_CONNECTED) {
    if (millis() - begun_ms > kJoinMs) {
      if (++failed_joins_ >= kJoinsBeforeRestart) {
        failed_joins_ = 0;
        is_started_ = false;
        WiFi.end();
      } else {
        disconnect();
      }
      return false;
    }
    board_.feed_watchdog();
    delay(kLookMs);
  }
  failed_joins_ = 0;
  is_connected_ = true;
  asked_ms_ = millis();
  WiFi.noLowPowerMode();
  ask_radio();
  return true;
}

void NinaLink::ask_radio() {
  radio_ = Radio();
  radio_.is_winc1500 = false;
  const char* version = WiFi.firmwareVersion();
  if (version == nullptr || !parse_version(version, radio_.firmware)) return;
  const int32_t rssi_dbm = WiFi.RSSI();
  board_.feed_watchdog();
  if (rssi_dbm >= INT8_MIN && rssi_dbm < 0) radio_.rssi_dbm = static_cast<int8_t>(rssi_dbm);
}

void NinaLink::leave() {
  if (is_started_) disconnect();
}

void NinaLink::disconnect() {
  is_connected_ = false;
  udp_.stop();
  WiFi.disconnect();
  const unsigned long asked_ms = millis();
  while (WiFi.status() == WL_CONNECTED && millis() - asked_ms < kDisconnectMs) {
  }
}

bool NinaLink::open(uint16_t port) {
  port_ = port;
  unsent_ = 0;
  udp_.stop();
  return udp_.begin(port) == 1;
}

bool NinaLink::send(const Address& to, const uint8_t* data, uint16_t count) {
  const bool is_sent = udp_.beginPacket(IPAddress(to.ip), to.port) == 1 && udp_.write(data, count) == count &&
                       udp_.endPacket() == 1;
  unsent_ = is_sent ? uint8_t{0} : static_cast<uint8_t>(unsent_ + 1);
  if (unsent_ >= kUnsentBeforeReopening && !open(port_)) is_connected_ = false;  // down until the next join
  return is_sent;
}

// To the network's own broadcast address: the limited one (255.255.255.255) names no network.
bool NinaLink::broadcast(uint16_t port, const uint8_t* data, uint16_t count) {
  const uint32_t own = WiFi.localIP(), mask = WiFi.subnetMask();
  return send({own | ~mask, port}, data, count);
}

// The sender is asked before the bytes are read, and each question is a conversation: only when something came.
uint16_t NinaLink::receive(uint8_t* data, uint16_t room, Address& from) {
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
