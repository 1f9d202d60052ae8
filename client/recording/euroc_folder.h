// Reads recordings in the format of EuRoC (Burri et al. 2016), which TUM-VI
// shares:
//
//   mav0/camN/data.csv, mav0/camN/data/STAMP.png, mav0/camN/sensor.yaml
//   mav0/imu0/data.csv
//
// Lists are read at once, images when they are asked for, so that a recording
// of any length needs little memory. What is broken is reported in one sentence
// with the file, and for a list with the line; nothing aborts. Immutable: any
// thread may read images.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/recording/png_image.h"
#include "core/model/camera.h"
#include "core/model/segment.h"

namespace selfcal::client {

struct EurocImage {
  std::int64_t t_ns = 0;
  std::string path;
};

struct EurocCamera {
  std::string name;                // "cam0"
  std::vector<EurocImage> images;  // in order of time
  // Nothing without a sensor.yaml.
  std::optional<CameraCalibration> calibration;
};

struct EurocRecording {
  std::vector<EurocCamera> cameras;  // cam0, cam1, ...: at least one
  std::vector<ImuSample> imu;        // in order of time: at least one
  // A sentence for each list with images that are missing, as in recordings
  // that were cut; they are left out.
  std::vector<std::string> problems;
};

// Opens the recording in `folder`, which contains mav0 or is it. NOT_FOUND for
// a list that is missing, or all images of one, INVALID_ARGUMENT for a line
// that cannot be parsed or a timestamp that is not later than the one before.
absl::StatusOr<EurocRecording> OpenEuroc(const std::string& folder);

// Reads an image of a camera. DATA_LOSS for one that is cut off or, if the
// camera has a sensor.yaml, of another size.
absl::StatusOr<GreyPixels> ReadImage(const EurocCamera& camera,
                                     const EurocImage& image);

// Images with the same timestamp: for each camera the index of its image, or
// -1.
struct ImageSet {
  std::int64_t t_ns = 0;
  std::vector<int> images;
};
std::vector<ImageSet> ImageSets(const EurocRecording& recording);

}  // namespace selfcal::client
