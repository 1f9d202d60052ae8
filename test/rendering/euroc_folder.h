// Writes a rendered recording as a folder in the format of EuRoC (Burri et al.
// 2016), with its truth.
//
//   mav0/camN/data.csv, mav0/camN/data/STAMP.png, mav0/camN/sensor.yaml
//   mav0/imu0/data.csv, mav0/imu0/sensor.yaml   and of imu1, if there is one
//   mav0/state_groundtruth_estimate0/data.csv, .../sensor.yaml
//   calibration.json      the truth, a selfcal.v1.CalibrationParameters
//
// The first IMU is the body frame of the format. A camera's sensor.yaml has
// further keys for what the format lacks: time_offset_s, line_delay_s,
// exposure_s.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>

#include "test/rendering/rendered_recording.h"

namespace selfcal {

// Stamps of the files are those of the recording plus this.
inline constexpr std::int64_t kEurocEpoch_ns = 1'400'000'000'000'000'000;

// Each sensor.yaml has what `stated` says, the truth or another start.
// `written` is called after each image with their number so far. Throws
// std::runtime_error with the path of a file that cannot be written. Files that
// exist are replaced.
void WriteEurocFolder(const RenderedRecording& recording,
                      const Calibration& stated,
                      const std::filesystem::path& folder,
                      const std::function<void(int)>& written = {});

}  // namespace selfcal
