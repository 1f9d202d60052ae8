// Recordings as a folder of images with lists, one recording a folder:
//
//   cam0.csv, cam1.csv, ...   time [ns], name of the image's file
//   imu.csv                   time [ns], gyroscope x y z [rad/s],
//                             accelerometer x y z [m/s^2]
//   imu1.csv                  the same of a second IMU, if there is one
//
// Names of files are relative to the folder. Lines that begin with # are
// comments, and a first line that begins with a letter is a heading.
#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "client/recording/recording.h"

namespace selfcal::client {

// True for a folder that contains cam0.csv.
bool IsCsvFolder(const std::string& path);

absl::StatusOr<std::unique_ptr<Recording>> OpenCsvFolder(
    const std::string& folder);

}  // namespace selfcal::client
