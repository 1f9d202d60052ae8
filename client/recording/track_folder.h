// A recording of tracks instead of images: any SLAM system with a front end of
// its own can write one.
//
//   tracks.csv   time [ns], camera, landmark, x, y [px]; in any order
//   imu.csv      as of csv_list.h
//   imu1.csv     the same of a second IMU, if there is one
//
// Cameras are numbered from 0. A landmark is a number that means the same point
// of the scene in all images and cameras. Pixels are those of the original,
// distorted image.
#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "client/recording/recording.h"

namespace selfcal::client {

bool IsTrackFolder(const std::string& path);

// Errors are as of csv_list.h. A point that is listed twice is left out, with
// one sentence.
absl::StatusOr<std::unique_ptr<Recording>> OpenTrackFolder(
    const std::string& folder);

}  // namespace selfcal::client
