// Tracks of a rendered recording, with their errors.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "client/tracking/feature_tracker.h"
#include "test/rendering/rendered_recording.h"

namespace selfcal {

struct TrackError {
  client::TrackPoint point;
  int age = 0;          // images since the first of the track in its camera
  bool first = false;   // where the landmark began: no error by definition
  bool in_view = true;  // the truth has a pixel
  bool moving = false;  // on a moving box
  Eigen::Vector2d error_px = Eigen::Vector2d::Zero();
};

struct TrackedRecording {
  std::vector<TrackError> errors;              // image by image
  std::vector<client::TrackingCounts> counts;  // for each image
  double cpu_ms = 0;  // of the tracker alone, for each image set, without the
                      // first one
};

// Tracks `images` images with a calibration that need not be the true one. The
// truth of a track is the point of the scene that its first pixel shows.
TrackedRecording TrackRecording(const RenderedRecording& recording,
                                const Calibration& theta,
                                const client::TrackerOptions& options,
                                int images);

// A point farther than this from the truth is an outlier.
inline constexpr double kOutlier_px = 3;

// Errors of the points that are neither first, nor outliers. All zero without
// any.
struct ErrorStatistics {
  int points = 0;  // outliers included
  double outlier_share = 0;
  double moving_share = 0;  // of all points, the first ones included
  double mean_length = 0;   // of tracks that have ended or not [images]
  double median_px = 0;     // of the distance
  double sigma_px = 0;      // of an axis, from the squares
  double p75_px = 0;        // of the distance
  double p90_px = 0;
  double p95_px = 0;
  double p99_px = 0;
  double correlation = 0;  // with the error in the image before
};
ErrorStatistics Summarise(const TrackedRecording& tracked);

// Correlation of the errors of a track that are this many images apart, of
// points that are neither first nor farther than kGoodPoint_px from the truth:
// a few bad tracks do not decide it. 0 without any.
inline constexpr double kGoodPoint_px = 0.3;
double CorrelationAfter(const TrackedRecording& tracked, int images);

// Standard deviation of an axis over points of this age, without outliers; 0
// for fewer than 20.
double SigmaAtAge(const TrackedRecording& tracked, int age);

}  // namespace selfcal
