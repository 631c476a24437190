// The wearable on an Arduino MKR1000 with a BNO055: only glue. The logic is in src/core.
#include "src/arduino/board_clock.h"
#include "src/arduino/mkr_board.h"
#include "src/arduino/nvm_store.h"
#include "src/arduino/usb_serial.h"
#include "src/arduino/wifi_link.h"
#include "src/arduino/wire_bus.h"
#include "src/core/bno055.h"
#include "src/core/wearable.h"

namespace {

bunraku::BoardClock board_clock;
bunraku::MkrBoard board;
bunraku::BuiltinLed led;
bunraku::NvmStore store;
bunraku::UsbSerial cable;
bunraku::WifiLink wifi(board);
bunraku::WireBus bus;
bunraku::Bno055 imu(bus);
bunraku::Wearable wearable({board_clock, imu, wifi, cable, store, led, board});

}  // namespace

void setup() {
  board.begin();
  led.begin();
  cable.begin();
  bus.begin();
  wearable.begin();
}

void loop() { wearable.step(); }
