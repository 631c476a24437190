// Root, sine and cosine in single precision without a C library's mathematics.
#pragma once

#include <stdint.h>
#include <string.h>

namespace bunraku {

// Square root of a number >= 0: a first guess from the exponent, then Newton's steps for its reciprocal.
inline float root(float square) {
  if (square < 1e-30f) return 0;
  uint32_t bits;
  memcpy(&bits, &square, sizeof bits);
  bits = 0x5F375A86u - (bits >> 1);
  float reciprocal;
  memcpy(&reciprocal, &bits, sizeof reciprocal);
  for (uint8_t i = 0; i < 3; ++i) reciprocal *= 1.5f - 0.5f * square * reciprocal * reciprocal;
  const float estimate = square * reciprocal;
  return 0.5f * (estimate + square / estimate);
}

// For |angle| < 0.5, half of what a gyroscope turns in a sample: the next term is below 1e-8.
inline float sine(float angle) {
  const float s = angle * angle;
  return angle * (1 - s / 6 * (1 - s / 20 * (1 - s / 42)));
}
inline float cosine(float angle) {
  const float s = angle * angle;
  return 1 - s / 2 * (1 - s / 12 * (1 - s / 30 * (1 - s / 56)));
}

}  // namespace bunraku
