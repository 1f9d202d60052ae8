// Reads a recording image set by image set, with the tracks in it: the points
// that it has, or those that the front end finds in its images.
//
// Not thread-safe.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "client/odometry/odometry.h"
#include "client/recording/recording.h"
#include "client/tracking/feature_tracker.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal::client {

struct TrackedKeyframe {
  std::int64_t t_ns = 0;
  std::vector<TrackPoint> points;
};

class KeyframeReader {
 public:
  // Tracks are predicted with theta, at the temperature of the recording, which
  // must outlive the object. Begins after options.after_ns.
  KeyframeReader(Recording* recording,
                 const Rig& rig,
                 const Calibration& theta,
                 const OdometryOptions& options);

  bool more() const { return next_set_ < sets_.size(); }
  // Reads the next set, if there are more: a keyframe, or nullopt if it is none
  // or the readings do not cover it. Fails as Odometry::Next.
  absl::StatusOr<std::optional<TrackedKeyframe>> Next();

  std::optional<std::int64_t> session_start_ns() const;
  const OdometryProgress& progress() const { return progress_; }

 private:
  // The points that the recording has instead of images; nullopt for one with
  // images.
  std::optional<std::vector<TrackPoint>> RecordedPoints(
      const ImageSet& set) const;
  // Images that cannot be read stay empty, and are counted.
  absl::Status ReadImages(const ImageSet& set, std::vector<GreyPixels>* pixels);
  // Follows the tracks into the images of a set.
  absl::StatusOr<std::vector<TrackPoint>> Follow(const ImageSet& set);
  bool Covered(std::int64_t t_ns) const;

  Recording* recording_;
  const std::vector<CameraCalibration> cameras_;
  const bool has_second_imu_;
  const std::vector<ImageSet> sets_;
  const int step_;
  FeatureTracker tracker_;
  OdometryProgress progress_;
  std::size_t next_set_ = 0;
  std::size_t next_sample_ = 0;
};

}  // namespace selfcal::client
