// Visual-inertial odometry of a recording: images and readings to motion
// segments, one after the other, as the daemon takes them.
//
// Tracks are followed through all images (client/tracking), or are those of a
// recording that has tracks instead of images; every n-th image is
// a keyframe; the motion of each segment is estimated with the calibration that
// the caller passes (core/motion), from where the segment before it ended, by
// the first IMU; a second one that the rig has only adds its readings.
// There is no map: a landmark lives as long as its track. A segment whose
// motion cannot be found is returned without one, with the reason, and the next
// one begins afresh. So does one after a gap of images.
//
// Memory holds the readings, the tracks of one segment and the images of two
// stamps. Not thread-safe. The same recording gives the same segments on one
// machine.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "client/recording/recording.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal::client {

struct OdometryOptions {
  std::string session;
  // The first segment has this index, and only images later than this stamp.
  std::int64_t first_index = 0;
  std::optional<std::int64_t> after_ns = std::nullopt;
  double keyframe_rate_hz = 10;  // at most; images are what there is
  int keyframes = 40;            // of a segment
  // The rest of a recording, or before a gap, is dropped below this number.
  int min_keyframes = 20;
  // Landmarks with fewer keyframes in a segment are left out of it.
  int min_observations = 3;
  double max_gap_s = 0.6;  // between keyframes of one segment
  // Temperature of the device [deg C] in all segments, if it is known.
  std::optional<double> temperature_c = std::nullopt;
};

struct OdometrySegment {
  MotionSegment segment;
  // The reason why the motion was not found, a clause; empty if it was.
  std::string failure;
  double reprojection_rms_px = 0;
};

// Images that were read so far, for a progress bar.
struct OdometryProgress {
  std::size_t images = 0;  // stamps, read
  std::size_t of = 0;
  std::size_t unreadable = 0;  // images that could not be read, left out
  std::string last_error;      // of these
};

class Odometry {
 public:
  // The cameras of the rig are those of the recording, in this order, and a
  // recording has readings of a second IMU if the rig has one. Tracks are
  // predicted with theta. `recording` must outlive the object.
  Odometry(Recording* recording,
           const Rig& rig,
           const Calibration& theta,
           const OdometryOptions& options);
  ~Odometry();
  Odometry(const Odometry&) = delete;
  Odometry& operator=(const Odometry&) = delete;

  // The next segment, with the motion under theta, which is `version` of the
  // rig; nullopt at the end of the recording. INVALID_ARGUMENT for images of
  // another size than the camera's, DATA_LOSS if more than half of the images
  // so far, and at least ten, could not be read.
  absl::StatusOr<std::optional<OdometrySegment>> Next(const Calibration& theta,
                                                      std::int64_t version);

  const OdometryProgress& progress() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace selfcal::client
