// A recording of cameras and an IMU, in any container:
//
//   folder of EuRoC's format (Burri et al. 2016), TUM-VI's included
//   folder of images with cam0.csv, cam1.csv, ... and imu.csv, imu1.csv
//   folder of tracks, without images, with tracks.csv and imu.csv, imu1.csv
//   bag of ROS 1
//   bag of ROS 2, in MCAP or SQLite: a file, or the folder with metadata.yaml
//
// Lists of times and readings are read at once, images when they are asked for,
// so that a recording of any length needs little memory. docs/recordings.md
// describes the containers.
#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/recording/grey_pixels.h"
#include "core/model/calibration.h"
#include "core/model/camera.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal::client {

struct RecordedCamera {
  std::string name;  // "cam0"
  // Stamps of the images, each later than the one before.
  std::vector<std::int64_t> image_times_ns;
  // The calibration that the recording states, if it does.
  std::optional<CameraCalibration> calibration;
  // False if the recording states no pose: that of `calibration` is the
  // identity.
  bool has_pose = false;
};

// A point of the scene in an image.
struct RecordedPoint {
  std::uint64_t landmark = 0;  // the same in all images and cameras
  Eigen::Vector2d z_px = Eigen::Vector2d::Zero();
};

struct RecordedData {
  std::vector<RecordedCamera> cameras;  // at least one, each with an image
  std::vector<ImuSample> imu;   // each later than the one before; at least one
  std::vector<ImuSample> imu1;  // of a second IMU, by the same clock
  // That the recording states, if it does; of the second IMU with its pose.
  std::optional<ImuNoise> imu_noise, imu1_noise;
  std::optional<SecondImuCalibration> imu1_calibration;
  std::vector<std::string> problems;
};

// An open recording. Not thread-safe: one call at a time.
class Recording {
 public:
  virtual ~Recording() = default;
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;

  const std::vector<RecordedCamera>& cameras() const { return data_.cameras; }
  const std::vector<ImuSample>& imu() const { return data_.imu; }
  // Those of a second IMU; empty if there is none.
  const std::vector<ImuSample>& imu1() const { return data_.imu1; }
  const std::optional<ImuNoise>& imu_noise() const { return data_.imu_noise; }
  const std::optional<ImuNoise>& imu1_noise() const { return data_.imu1_noise; }
  const std::optional<SecondImuCalibration>& imu1_calibration() const {
    return data_.imu1_calibration;
  }
  // Parts that were left out or repaired: a sentence each.
  const std::vector<std::string>& problems() const { return data_.problems; }

  // Adds a time to the stamps of all readings, where cameras and IMUs have
  // clocks of their own.
  void ShiftReadings(std::int64_t by_ns);

  // Reads an image by its index in image_times_ns of a camera. DATA_LOSS with
  // the file for one that is damaged or, if the camera has a calibration, of
  // another size; NOT_FOUND for a file that is gone.
  virtual absl::StatusOr<GreyPixels> ReadImage(int camera, int image) = 0;

  // The points of an image, by landmark, of a recording that has tracks instead
  // of images; null for one with images.
  virtual const std::vector<RecordedPoint>* Points(int /*camera*/,
                                                   int /*image*/) const {
    return nullptr;
  }

 protected:
  explicit Recording(RecordedData data) : data_(std::move(data)) {}

  // The result of ReadImage for pixels that were read from `where`: an error
  // with that name, also if camera j has a calibration for another size.
  absl::StatusOr<GreyPixels> Checked(absl::StatusOr<GreyPixels> pixels,
                                     const std::string& where,
                                     int j) const;

 private:
  RecordedData data_;
};

// Images of one time: for each camera the index of its image, or -1. The stamp
// is that of the earliest.
struct ImageSet {
  std::int64_t t_ns = 0;
  std::vector<int> images;
};
// Drivers stamp the images of cameras that are exposed together one after the
// other: images no further apart than this, of different cameras, are a set.
inline constexpr double kSameTime_s = 2e-3;
// All images, in order of time.
std::vector<ImageSet> ImageSets(const Recording& recording);

// Says in one sentence how much the stamps within a set differ; nullopt if none
// do.
std::optional<std::string> StampDifferences(const Recording& recording);

// Topics of a bag. Those that are not stated are found by their types: each
// topic of images is a camera, in the order of their names.
struct RecordingOptions {
  std::vector<std::string> camera_topics;  // in the order of the cameras
  std::vector<std::string> imu_topics;     // of the first IMU, and the second
};

// Opens a recording, whose container is recognised by its content. NOT_FOUND if
// there is none, or no images or readings in it, INVALID_ARGUMENT for one that
// is not as its format demands; one sentence with the file, and for a list with
// the line.
absl::StatusOr<std::unique_ptr<Recording>> OpenRecording(
    const std::string& path, const RecordingOptions& options);

}  // namespace selfcal::client
