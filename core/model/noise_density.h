// Noise of an IMU's readings: density of the continuous process, and standard
// deviation of single readings.
//
// White noise of density N [unit/sqrt(Hz)], averaged over the time between two
// readings, has the variance N^2 f at the rate f (Kalibr's wiki, page "IMU
// Noise Model"). That holds for readings whose filter passes half their rate. A
// narrower one makes single readings quieter, and their sum over time is not:
// their density is larger than this.
#pragma once

#include <cmath>

namespace selfcal {

// Density [unit/sqrt(Hz)] of readings with this standard deviation [unit] at
// this rate [Hz], which is positive.
inline double NoiseDensity(double reading_sigma, double rate_hz) {
  return reading_sigma / std::sqrt(rate_hz);
}

// The inverse: the standard deviation of readings.
inline double ReadingSigma(double noise_density, double rate_hz) {
  return noise_density * std::sqrt(rate_hz);
}

}  // namespace selfcal
