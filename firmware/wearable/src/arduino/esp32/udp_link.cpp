// Wi-Fi of an ESP32-S3 board, and one UDP socket of its lwIP.
#include "../board.h"
#ifdef BUNRAKU_ESP32

#include <Arduino.h>
#include <WiFi.h>
#include <esp_idf_version.h>
#include <lwip/sockets.h>

#include "udp_link.h"

namespace bunraku {
namespace {

constexpr unsigned long kJoinMs = 10000;
constexpr unsigned long kLookMs = 20;     // between looks whether it has joined
constexpr uint8_t kMostSkipped = 4;       // empty or foreign datagrams in a call

sockaddr_in address_of(uint32_t ip, uint16_t port) {
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = ip;
  return address;
}

}  // namespace

bool UdpLink::is_up() { return is_started_ && socket_ >= 0 && WiFi.status() == WL_CONNECTED; }

bool UdpLink::join(const char* network, const char* password) {
  leave();
  if (!is_started_) {
    WiFi.persistent(false);  // the settings are ours to keep
    is_started_ = WiFi.mode(WIFI_STA);
    WiFi.setAutoReconnect(false);
  }
  if (!is_started_) return false;
  const unsigned long begun_ms = millis();
  password[0] == '\0' ? WiFi.begin(network) : WiFi.begin(network, password);
  while (WiFi.status() != WL_CONNECTED) {
    if (millis() - begun_ms > kJoinMs) {
      WiFi.disconnect();
      return false;
    }
    board_.feed_watchdog();
    delay(kLookMs);
  }
  WiFi.setSleep(false);  // power save would hold packets back for up to a beacon interval, 100 ms
  radio_ = Radio();
  radio_.is_winc1500 = false;
  radio_.firmware[0] = ESP_IDF_VERSION_MAJOR;
  radio_.firmware[1] = ESP_IDF_VERSION_MINOR;
  radio_.firmware[2] = ESP_IDF_VERSION_PATCH;
  radio_.rssi_dbm = WiFi.RSSI();
  return true;
}

void UdpLink::leave() {
  close_socket();
  if (is_started_) WiFi.disconnect();
}

bool UdpLink::open(uint16_t port) {
  close_socket();
  socket_ = socket(AF_INET, SOCK_DGRAM, 0);
  if (socket_ < 0) return false;
  const int yes = 1;
  const sockaddr_in own = address_of(INADDR_ANY, port);
  const bool is_open = setsockopt(socket_, SOL_SOCKET, SO_BROADCAST, &yes, sizeof yes) == 0 &&
                       bind(socket_, reinterpret_cast<const sockaddr*>(&own), sizeof own) == 0;
  if (!is_open) close_socket();
  return is_open;
}

void UdpLink::close_socket() {
  if (socket_ >= 0) close(socket_);
  socket_ = -1;
}

bool UdpLink::send(const Address& to, const uint8_t* data, uint16_t count) {
  if (socket_ < 0) return false;
  const sockaddr_in there = address_of(to.ip, to.port);
  return sendto(socket_, data, count, MSG_DONTWAIT, reinterpret_cast<const sockaddr*>(&there), sizeof there) ==
         count;
}

bool UdpLink::broadcast(uint16_t port, const uint8_t* data, uint16_t count) {
  const uint32_t everyone = WiFi.broadcastIP();
  return send({everyone, port}, data, count);
}

// An empty datagram is one too: it is taken and skipped.
uint16_t UdpLink::receive(uint8_t* data, uint16_t room, Address& from) {
  for (uint8_t i = 0; i < kMostSkipped && socket_ >= 0; ++i) {
    sockaddr_in sender = {};
    socklen_t bytes = sizeof sender;
    const auto count = recvfrom(socket_, data, room, MSG_DONTWAIT, reinterpret_cast<sockaddr*>(&sender), &bytes);
    if (count < 0) return 0;
    if (count == 0 || sender.sin_family != AF_INET) continue;
    from = {sender.sin_addr.s_addr, ntohs(sender.sin_port)};
    return static_cast<uint16_t>(count);
  }
  return 0;
}

}  // namespace bunraku

#endif
