// The core's interfaces to the world, implemented by the sketch and by the simulation.
// No call may block longer than its comment states: the core streams at 50 Hz on one thread.
#pragma once

#include <stdint.h>

#include "imu.h"

namespace bunraku {

class Clock {
 public:
  virtual uint32_t micros() = 0;  // wraps after 71.6 minutes

 protected:
  ~Clock() = default;
};

// The bus of the inertial unit. A call returns false on NACK or a bus error; 22 bytes of a BNO055 take about 5 ms.
// The core's drivers have it; a wearable has the driver.
class I2cBus {
 public:
  virtual bool write(uint8_t address, uint8_t reg, const uint8_t* data, uint8_t count) = 0;
  virtual bool read(uint8_t address, uint8_t reg, uint8_t* data, uint8_t count) = 0;
  virtual bool receive(uint8_t, uint8_t*, uint8_t) { return false; }  // read(), of a chip without registers
  virtual void recover() = 0;  // nine clocks and a stop for a slave that holds the data line

 protected:
  ~I2cBus() = default;
};

// Facts that a Wi-Fi module reports about itself.
struct Radio {
  uint8_t firmware[3] = {};  // its own firmware's version; zeros: unknown
  int8_t rssi_dbm = 0;       // how strong the access point was when it was joined; 0: unknown
  bool is_winc1500 = true;   // the MKR1000's, whose old firmware is known to hang

  bool is_known() const { return (firmware[0] | firmware[1] | firmware[2]) != 0; }
};

struct Address {
  uint32_t ip;  // as the driver has it; the core only hands it back
  uint16_t port;
};

// Wi-Fi and one UDP socket. Calls marked with (blocks) stop everything: never made while linked.
class DatagramLink {
 public:
  virtual bool is_up() = 0;  // joined, by the driver's own word, which can be stale: the heartbeat tells
  virtual bool join(const char* network, const char* password) = 0;  // (blocks, up to 10 s) true: joined
  virtual void leave() = 0;  // (blocks, up to 0.5 s)
  virtual bool open(uint16_t port) = 0;  // (blocks, up to 2 s) a disconnect has closed the socket
  virtual bool send(const Address& to, const uint8_t* data, uint16_t count) = 0;
  virtual bool broadcast(uint16_t port, const uint8_t* data, uint16_t count) = 0;
  virtual uint16_t receive(uint8_t* data, uint16_t room, Address& from) = 0;  // 0: nothing waits
  virtual Radio radio() { return {}; }  // as it was at the last join

 protected:
  ~DatagramLink() = default;
};

// USB serial. Neither call waits: what does not fit is not written.
class SerialPort {
 public:
  virtual bool is_connected() = 0;  // a host has the port open
  virtual uint16_t read(uint8_t* data, uint16_t room) = 0;
  virtual uint16_t write(const uint8_t* data, uint16_t count) = 0;  // how much was taken

 protected:
  ~SerialPort() = default;
};

// Small records that survive power-off; erased by an upload of new firmware. Slots 0 to 3, each up to 192
// bytes and in its own erase block: a power cut during a write loses only that one.
class FlashStore {
 public:
  virtual bool load(uint8_t slot, uint8_t* data, uint16_t count) = 0;  // false: never written
  virtual bool save(uint8_t slot, const uint8_t* data, uint16_t count) = 0;  // (blocks, some 10 ms)

 protected:
  ~FlashStore() = default;
};

class Led {
 public:
  virtual void set(bool is_on) = 0;

 protected:
  ~Led() = default;
};

// The rest of the board.
class Board {
 public:
  virtual uint16_t battery_millivolts() = 0;  // 0: unknown
  virtual void noise(uint8_t* data, uint8_t count) = 0;  // unpredictable bytes, as good as the board has them
  virtual void feed_watchdog() = 0;
  virtual void restart() = 0;  // does not return on the real board
  virtual bool was_reset_by_watchdog() { return false; }  // the start before this one hung
  virtual uint32_t serial_number() { return 0; }  // the processor's, folded; 0: it has none

 protected:
  ~Board() = default;
};

struct Ports {
  Clock& clock;
  Imu& imu;
  DatagramLink& wifi;
  SerialPort& serial;
  FlashStore& flash;
  Led& led;
  Board& board;
};

}  // namespace bunraku
