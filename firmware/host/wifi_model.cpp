// The air: association, delivery, and how long each call blocks the wearable.
#include "wifi_model.h"

#include <algorithm>
#include <limits>

namespace bunraku {
namespace {

constexpr size_t kRadioBuffer = 16;     // datagrams that the radio keeps for the board
constexpr size_t kMostUntaken = 4096;   // sent and not fetched by the world: the oldest go
constexpr uint64_t kForEverUs = 16'100'000;  // longer than the watchdog waits
constexpr uint64_t kNever = std::numeric_limits<uint64_t>::max();

}  // namespace

bool WifiModel::is_up() {
  if (is_joined_ && !is_carrying()) {
    const uint64_t noticed_us = next_change(false, joined_at_us_) + stale_us_;
    if (clock_.now_us() >= noticed_us) leave();
  }
  return is_joined_;
}

bool WifiModel::join(const char* network, const char* password) {
  leave();
  const uint64_t start_us = clock_.now_us();
  if (conditions.is_dead) {
    clock_.advance(kForEverUs);
    return false;
  }
  const uint64_t deadline_us = start_us + conditions.join_timeout_us;
  const uint64_t heard_us = is_on_air(start_us) ? start_us : next_change(true, start_us);
  const uint64_t took_us = chosen(conditions.join_us);
  const bool is_known = network_ == network && password_ == password;
  if (!is_known || heard_us >= deadline_us || heard_us + took_us > deadline_us ||
      next_change(false, heard_us) <= heard_us + took_us || random_.happens(conditions.join_failures)) {
    join_us_[0] = start_us, join_us_[1] = deadline_us;
    clock_.advance_to(deadline_us);
    ++counts.failed_joins;
    return false;
  }
  join_us_[0] = start_us, join_us_[1] = heard_us + took_us;
  clock_.advance_to(heard_us + took_us);
  is_joined_ = true;
  joined_at_us_ = clock_.now_us();
  stale_us_ = chosen(conditions.stale_us);
  ++counts.joins;
  return true;
}

void WifiModel::leave() {
  is_joined_ = false;
  port_ = 0;
  counts.unheard += static_cast<uint32_t>(arriving_.size());
  arriving_.clear();
}

bool WifiModel::open(uint16_t port) {
  if (!is_up()) return false;
  clock_.advance(chosen(conditions.open_us));
  port_ = port;
  ++counts.opens;
  return true;
}

bool WifiModel::send(const Address& to, const uint8_t* data, uint16_t count) { return emit(to, data, count); }

bool WifiModel::broadcast(uint16_t port, const uint8_t* data, uint16_t count) {
  return emit({kBroadcast, port}, data, count);
}

uint16_t WifiModel::receive(uint8_t* data, uint16_t room, Address& from) {
  if (port_ == 0 || arriving_.empty()) return 0;
  clock_.advance(conditions.receive_us);
  const Datagram datagram = arriving_.front();
  arriving_.pop_front();
  const size_t count = std::min<size_t>(room, datagram.data.size());
  std::copy_n(datagram.data.begin(), count, data);
  from = datagram.address;
  return static_cast<uint16_t>(count);
}

void WifiModel::set_network(const std::string& name, const std::string& password) {
  network_ = name;
  password_ = password;
}

void WifiModel::set_access_point(bool is_on, uint64_t at_us) {
  if (access_point_.back().is_on != is_on) access_point_.push_back({at_us, is_on});
}

bool WifiModel::deliver(const Datagram& datagram) {
  if (datagram.data.empty()) return false;
  if (port_ == 0 || !is_carrying() || arriving_.size() >= kRadioBuffer) {
    ++counts.unheard;
    return false;
  }
  if (random_.happens(conditions.loss)) {
    ++counts.lost;
    return false;
  }
  arriving_.push_back(datagram);
  return true;
}

bool WifiModel::take(Datagram& datagram) {
  if (leaving_.empty()) return false;
  datagram = leaving_.front();
  leaving_.pop_front();
  return true;
}

void WifiModel::forget_after(uint64_t at_us) {
  while (!leaving_.empty() && leaving_.back().at_us > at_us) leaving_.pop_back();
  join_us_[1] = std::min(join_us_[1], at_us);
}

bool WifiModel::is_carrying() const { return is_joined_ && next_change(false, joined_at_us_) > clock_.now_us(); }

bool WifiModel::is_on_air(uint64_t at_us) const {
  bool is_on = false;
  for (const Change& change : access_point_) {
    if (change.at_us <= at_us) is_on = change.is_on;
  }
  return is_on;
}

uint64_t WifiModel::next_change(bool is_on, uint64_t after_us) const {
  for (const Change& change : access_point_) {
    if (change.at_us > after_us && change.is_on == is_on) return change.at_us;
  }
  return kNever;
}

bool WifiModel::emit(const Address& to, const uint8_t* data, uint16_t count) {
  clock_.advance(conditions.send_us);
  if (port_ == 0 || !is_joined_ || random_.happens(conditions.send_failures)) {
    ++counts.refused;
    return false;
  }
  ++counts.sent;
  if (!is_carrying() || random_.happens(conditions.loss)) {
    ++counts.lost;
    return true;  // the driver has taken it; its loss goes unreported
  }
  if (leaving_.size() >= kMostUntaken) leaving_.pop_front();
  leaving_.push_back({clock_.now_us(), to, std::vector<uint8_t>(data, data + count)});
  return true;
}

}  // namespace bunraku
