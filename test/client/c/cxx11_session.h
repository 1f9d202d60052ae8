// A program in C++11, for the tests, which are in C++20.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "test/client/c/session.h"

namespace selfcal {
namespace testing_c {

struct Cxx11Outcome {
  std::vector<std::int64_t> stored;  // indices that were acknowledged
  std::uint64_t statistics_stored = 0;
  std::uint64_t callback_failures = 0;
  std::int64_t next_index = 0;
  std::int32_t drained = -1;  // code
};

// Streams the session to a daemon with selfcal.hpp, as the rig "device", in
// segments of 12 keyframes; a callback throws for segment 1.
Cxx11Outcome StreamInCxx11(const std::string& target, const Session& session);

struct Cxx11Calibration {
  std::int64_t version = 0;
  std::int32_t verdict = 0;
  std::vector<std::string> reasons;
  double focal_x = 0;
  std::string model;
  std::vector<double> sigmas;
  std::vector<double> covariance;
  double z_px[2] = {0, 0};
  bool behind = true;     // a point behind the camera was projected
  std::int32_t code = 0;  // of the error for a camera that does not exist
  std::uint64_t callbacks = 0;
};

// Waits for the active calibration of the rig "device".
Cxx11Calibration WatchInCxx11(const std::string& target);

// The message of the error for options without a rig.
std::string ErrorInCxx11();

}  // namespace testing_c
}  // namespace selfcal
