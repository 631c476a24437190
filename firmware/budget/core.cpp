// The code that the budget counts: one running wearable and its driver, with the other ports outside.
#include "bno055.h"
#include "wearable.h"

extern "C" void run_wearable(bunraku::I2cBus& bus, const bunraku::Ports& outside) {
  static bunraku::Bno055 imu(bus);
  static bunraku::Wearable wearable(
      {outside.clock, imu, outside.wifi, outside.serial, outside.flash, outside.led, outside.board});
  wearable.begin();
  for (;;) wearable.step();
}
