// The wearable's Wi-Fi as WiFi101 behaves: joining blocks, the status is stale, disconnects close the socket.
#pragma once

#include <deque>
#include <string>
#include <vector>

#include "ports.h"
#include "random.h"
#include "virtual_clock.h"

namespace bunraku {

constexpr uint32_t kBroadcast = 0xFFFFFFFFu;

struct Datagram {
  uint64_t at_us = 0;          // virtual time at which it was sent
  Address address{0, 0};       // destination (ip kBroadcast: all) or sender
  std::vector<uint8_t> data;
};

struct WifiConditions {
  uint32_t join_us[2] = {800'000, 2'500'000};    // how long joining takes, least and most
  uint32_t join_timeout_us = 10'000'000;         // how long it blocks without an access point
  uint32_t open_us[2] = {2'000, 60'000};         // how long opening the socket blocks
  uint32_t stale_us[2] = {2'000'000, 8'000'000};  // how long is_up() goes on after the access point went
  uint32_t send_us = 250;                        // one datagram over SPI to the radio
  uint32_t receive_us = 150;
  Radio radio = {{19, 6, 1}, -56};  // what it tells after a join
  bool is_dead = false;      // the radio: starting it hangs until the watchdog bites
  double join_failures = 0;  // share of joins that block to the end and fail
  double send_failures = 0;  // share of datagrams that the driver refuses
  double loss = 0;           // share lost on the air, either way
};

struct WifiCounts {
  uint32_t joins = 0;          // that succeeded
  uint32_t failed_joins = 0;
  uint32_t opens = 0;
  uint32_t sent = 0;           // handed to the driver, lost ones among them
  uint32_t refused = 0;        // send without a socket, or refused by the driver
  uint32_t lost = 0;           // either way
  uint32_t unheard = 0;        // came without a listener, or while the radio's buffer was full
};

class WifiModel : public DatagramLink {
 public:
  WifiModel(VirtualClock& clock, uint64_t seed) : clock_(clock), random_(seed) {}

  // The wearable's side.
  bool is_up() override;
  bool join(const char* network, const char* password) override;
  void leave() override;
  bool open(uint16_t port) override;
  bool send(const Address& to, const uint8_t* data, uint16_t count) override;
  bool broadcast(uint16_t port, const uint8_t* data, uint16_t count) override;
  uint16_t receive(uint8_t* data, uint16_t room, Address& from) override;
  Radio radio() override { return conditions.radio; }

  // The world's side. The access point: times never go back; a change may be announced ahead, which
  // matters for a join that blocks meanwhile.
  void set_network(const std::string& name, const std::string& password);
  void set_access_point(bool is_on, uint64_t at_us);
  void power_off() { leave(); }
  bool deliver(const Datagram& datagram);  // false: no receiver
  bool take(Datagram& datagram);           // the oldest that was sent and not lost
  void forget_after(uint64_t at_us);       // what was sent later
  bool is_carrying() const;                // whether what is sent now gets through
  bool is_joining(uint64_t at_us) const { return join_us_[0] <= at_us && at_us < join_us_[1]; }
  uint64_t joined_at_us() const { return joined_at_us_; }
  uint16_t port() const { return port_; }

  WifiConditions conditions;
  WifiCounts counts;

 private:
  struct Change {
    uint64_t at_us;
    bool is_on;
  };
  bool is_on_air(uint64_t at_us) const;
  uint64_t next_change(bool is_on, uint64_t after_us) const;  // never: the end of time
  uint64_t chosen(const uint32_t (&range)[2]) { return random_.between(range[0], range[1]); }
  bool emit(const Address& to, const uint8_t* data, uint16_t count);

  VirtualClock& clock_;
  Random random_;
  std::string network_, password_;
  std::vector<Change> access_point_{{0, true}};
  bool is_joined_ = false;  // by the driver's own word
  uint64_t joined_at_us_ = 0;
  uint64_t join_us_[2] = {0, 0};  // when the last join began and ended
  uint64_t stale_us_ = 0;   // drawn at each join
  uint16_t port_ = 0;       // 0: no socket
  std::deque<Datagram> arriving_, leaving_;
};

}  // namespace bunraku
