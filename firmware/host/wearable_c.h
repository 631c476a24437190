/* The simulated wearable for other languages. Times are microseconds of virtual time, which never goes back;
   functions that return int say 1 for yes and 0 for no unless they say else. */
#pragma once

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct wearable_world wearable_world;

typedef struct {
  uint64_t now_us;
  uint64_t booted_at_us;            /* when the board's clock began */
  uint64_t joined_at_us;            /* when the network was last joined; 0: never */
  uint64_t longest_unfed_us;        /* the longest that the watchdog was not fed */
  uint64_t longest_linked_step_us;  /* the longest turn of the loop while linked */
  uint32_t boot_nonce, session;
  uint32_t readings, skipped, unsent;  /* counts of this power-on */
  uint32_t malformed, foreign, forged, replayed, damaged_frames;
  uint32_t joins, failed_joins, sent, refused, lost, unheard;  /* Wi-Fi */
  uint32_t flash_saves, power_ons, restarts, watchdog_bites;
  uint16_t round_trip, battery_millivolts;
  uint8_t is_on, is_light_on, is_joined;
  uint8_t state; /* 0 not provisioned, 1 joining, 2 greeting, 3 linked */
  uint8_t lane;  /* 0 Wi-Fi, 1 cable, 2 none */
  uint8_t has_imu, has_profile, calibration, taps, recoveries, rate_hz, battery;
} wearable_status;

/* flash: an image from wearable_flash_image, or null for a new board. imu: the chip that is wired, "bno055",
   "bno085" or "lsm6dsv". Switched off at first. Null when the bytes are no image, or when there is no such chip. */
wearable_world* wearable_create(const uint8_t* flash, uint32_t flash_bytes, uint64_t seed, uint64_t start_us,
                                const char* imu);
void wearable_destroy(wearable_world* world);

void wearable_power(wearable_world* world, int is_on);
/* drift_ppm: how much too fast its clock is; first_us: what that clock shows at power-on. Before power-on. */
void wearable_set_clock(wearable_world* world, double drift_ppm, uint64_t first_us);
/* Runs until then and gives the time reached, which is later when a call of the firmware blocked. */
uint64_t wearable_step_until(wearable_world* world, uint64_t us);
/* As at the time that was asked for, also when a call blocks beyond it. */
void wearable_read_status(const wearable_world* world, wearable_status* status);

/* Wi-Fi. A change of the access point may be announced ahead; times never go back. */
void wearable_set_network(wearable_world* world, const char* name, const char* password);
void wearable_set_access_point(wearable_world* world, int is_on, uint64_t at_us);
int wearable_put_datagram(wearable_world* world, uint32_t ip, uint16_t port, const uint8_t* data, uint16_t count);
/* Bytes of the oldest datagram sent, 0 when there is none; ip 0xFFFFFFFF: to all. */
uint16_t wearable_take_datagram(wearable_world* world, uint64_t* at_us, uint32_t* ip, uint16_t* port,
                                uint8_t* data, uint16_t room);

/* The cable. Both give how many bytes were taken. */
void wearable_connect_cable(wearable_world* world, int is_connected);
uint16_t wearable_put_serial(wearable_world* world, const uint8_t* data, uint16_t count);
uint16_t wearable_take_serial(wearable_world* world, uint8_t* data, uint16_t room);

/* The hand: unit quaternions in the sensor's world (z up). Evenly from waypoint to waypoint. */
void wearable_stand(wearable_world* world, double w, double x, double y, double z);
void wearable_go_to(wearable_world* world, uint64_t at_us, double w, double x, double y, double z);
/* A double tap with a finger, now. */
void wearable_double_tap(wearable_world* world);

/* Trouble by its name in trouble.cpp. `inject` makes a fault of the IMU happen the next `times` times;
   `set_trouble` sets how bad something is: a probability, a rate, or 1 and 0.
   0: there is no such name. */
int wearable_inject(wearable_world* world, const char* fault, uint32_t times);
int wearable_set_trouble(wearable_world* world, const char* trouble, double amount);
void wearable_set_battery(wearable_world* world, uint16_t millivolts);

/* The lamp: its oldest change not taken yet: 1 on, 0 off, -1 none. */
int wearable_take_light(wearable_world* world, uint64_t* at_us);

/* The flash as an image: how many bytes it has; written when they fit the room. */
uint32_t wearable_flash_image(const wearable_world* world, uint8_t* data, uint32_t room);

#ifdef __cplusplus
}
#endif
