// The C face of the simulated world: plain calls, no exceptions, no ownership but create and destroy.
#include "wearable_c.h"

#include <algorithm>
#include <memory>
#include <vector>

#include "trouble.h"
#include "world.h"

struct wearable_world : bunraku::World {
  using bunraku::World::World;
};

namespace {

void tell_firmware(const bunraku::Status& from, wearable_status& to) {
  to.boot_nonce = from.boot_nonce;
  to.session = from.session;
  to.readings = from.readings;
  to.skipped = from.skipped;
  to.unsent = from.unsent;
  to.malformed = from.dropped.malformed;
  to.foreign = from.dropped.foreign;
  to.forged = from.dropped.forged;
  to.replayed = from.dropped.replayed;
  to.damaged_frames = from.damaged_frames;
  to.round_trip = from.round_trip;
  to.battery_millivolts = from.battery_millivolts;
  to.state = static_cast<uint8_t>(from.state);
  to.lane = static_cast<uint8_t>(from.lane);
  to.is_light_on = from.is_light_on;
  to.has_imu = from.has_imu;
  to.has_profile = from.has_profile;
  to.calibration = from.calibration;
  to.taps = from.taps;
  to.recoveries = from.recoveries;
  to.rate_hz = from.rate_hz;
  to.battery = from.battery;
}

}  // namespace

wearable_world* wearable_create(const uint8_t* flash, uint32_t flash_bytes, uint64_t seed, uint64_t start_us,
                                const char* imu) {
  bunraku::Wired wired;
  if (!bunraku::find_chip(imu, wired)) return nullptr;
  auto world = std::make_unique<wearable_world>(seed, start_us, wired);
  if (flash != nullptr && !world->flash.use_image(flash, flash_bytes)) return nullptr;
  return world.release();
}

void wearable_destroy(wearable_world* world) { delete world; }

void wearable_power(wearable_world* world, int is_on) { world->power(is_on != 0); }

void wearable_set_clock(wearable_world* world, double drift_ppm, uint64_t first_us) {
  world->board_clock.drift_ppm = drift_ppm;
  world->first_micros = first_us;
}

uint64_t wearable_step_until(wearable_world* world, uint64_t us) {
  world->step_until(us);
  return world->clock.now_us();
}

void wearable_read_status(const wearable_world* world, wearable_status* status) {
  *status = {};
  status->now_us = world->clock.now_us();
  status->booted_at_us = world->booted_at_us();
  status->joined_at_us = world->wifi.joined_at_us();
  status->longest_unfed_us = world->board.longest_unfed_us;
  status->longest_linked_step_us = world->counts.longest_linked_step_us;
  status->joins = world->wifi.counts.joins;
  status->failed_joins = world->wifi.counts.failed_joins;
  status->sent = world->wifi.counts.sent;
  status->refused = world->wifi.counts.refused;
  status->lost = world->wifi.counts.lost;
  status->unheard = world->wifi.counts.unheard;
  status->flash_saves = world->flash.saves;
  status->power_ons = world->counts.power_ons;
  status->restarts = world->counts.restarts;
  status->watchdog_bites = world->counts.watchdog_bites;
  status->is_on = world->is_on();
  status->is_joined = world->wifi.is_carrying();
  if (world->is_on()) tell_firmware(world->status(), *status);
}

void wearable_set_network(wearable_world* world, const char* name, const char* password) {
  world->wifi.set_network(name, password);
}

void wearable_set_access_point(wearable_world* world, int is_on, uint64_t at_us) {
  world->wifi.set_access_point(is_on != 0, at_us);
}

int wearable_put_datagram(wearable_world* world, uint32_t ip, uint16_t port, const uint8_t* data, uint16_t count) {
  return world->wifi.deliver({world->clock.now_us(), {ip, port}, std::vector<uint8_t>(data, data + count)});
}

uint16_t wearable_take_datagram(wearable_world* world, uint64_t* at_us, uint32_t* ip, uint16_t* port,
                                uint8_t* data, uint16_t room) {
  bunraku::Datagram datagram;
  if (!world->wifi.take(datagram)) return 0;
  *at_us = datagram.at_us;
  *ip = datagram.address.ip;
  *port = datagram.address.port;
  const size_t count = std::min<size_t>(room, datagram.data.size());
  std::copy_n(datagram.data.begin(), count, data);
  return static_cast<uint16_t>(count);
}

void wearable_connect_cable(wearable_world* world, int is_connected) { world->serial.connect(is_connected != 0); }

uint16_t wearable_put_serial(wearable_world* world, const uint8_t* data, uint16_t count) {
  return world->serial.put(data, count);
}

uint16_t wearable_take_serial(wearable_world* world, uint8_t* data, uint16_t room) {
  return world->serial.take(data, room);
}

void wearable_stand(wearable_world* world, double w, double x, double y, double z) {
  world->hand.stand({w, x, y, z});
}

void wearable_go_to(wearable_world* world, uint64_t at_us, double w, double x, double y, double z) {
  world->hand.go_to({w, x, y, z}, at_us);
}

void wearable_double_tap(wearable_world* world) {
  constexpr uint64_t kBetweenTapsUs = 220'000;
  world->imu.tap(world->clock.now_us());
  world->imu.tap(world->clock.now_us() + kBetweenTapsUs);
}

int wearable_inject(wearable_world* world, const char* fault, uint32_t times) {
  return bunraku::inject(*world, fault, times);
}

int wearable_set_trouble(wearable_world* world, const char* trouble, double amount) {
  return bunraku::set_trouble(*world, trouble, amount);
}

void wearable_set_battery(wearable_world* world, uint16_t millivolts) { world->board.millivolts = millivolts; }

int wearable_take_light(wearable_world* world, uint64_t* at_us) {
  bunraku::LedTrace::Change change;
  if (!world->led.take(change)) return -1;
  *at_us = change.at_us;
  return change.is_on;
}

uint32_t wearable_flash_image(const wearable_world* world, uint8_t* data, uint32_t room) {
  const std::vector<uint8_t> image = world->flash.image();
  if (data != nullptr && image.size() <= room) std::copy(image.begin(), image.end(), data);
  return static_cast<uint32_t>(image.size());
}
