// The core's VQF for other languages: tests compare it with the authors' program.
#include "vqf.h"

// Feeds `count` rates (rad/s, x y z), and after each `every`-th of them the next acceleration (m/s^2); writes the
// orientation after each rate (w x y z).
extern "C" void vqf_run(const float* rates, const float* accelerations, uint32_t count, float gyroscope_s,
                        uint32_t every, float* orientations) {
  bunraku::Vqf vqf;
  vqf.begin(gyroscope_s, gyroscope_s * static_cast<float>(every));
  const auto vector = [](const float* at) { return reinterpret_cast<const float (*)[3]>(at); };
  for (uint32_t i = 0; i < count; ++i) {
    vqf.feed_gyroscope(*vector(rates + 3 * i));
    if ((i + 1) % every == 0) {
      vqf.feed_accelerometer(*vector(accelerations));
      accelerations += 3;
    }
    vqf.orientation(*reinterpret_cast<float (*)[4]>(orientations + 4 * i));
  }
}
