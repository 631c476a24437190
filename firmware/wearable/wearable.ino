// The wearable on its board: only glue. The logic is in src/core, the boards and their parts in src/arduino.
#include "src/arduino/parts.h"
#include "src/core/wearable.h"

namespace {

bunraku::BoardClock board_clock;
bunraku::parts::Board board;
bunraku::parts::Lamp led;
bunraku::parts::Store store;
bunraku::parts::Cable cable;
bunraku::parts::Wifi wifi(board);
bunraku::parts::Bus bus;
bunraku::parts::Driver imu(bus);
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
