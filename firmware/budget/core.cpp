// The code that the budget counts: one running wearable, with its ports outside.
#include "wearable.h"

extern "C" void run_wearable(const bunraku::Ports& ports) {
  static bunraku::Wearable wearable(ports);
  wearable.begin();
  for (;;) wearable.step();
}
