// Variables and factors of a calibration, flattened from its segments: the
// common input of the solver, the landmarks and the covariance.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/calibration/partition.h"
#include "core/calibration/sharing_limits.h"
#include "core/factor/keyframe_motion.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// Keyframes are identified by their index into CalibrationProblem::keyframes.
struct TrackObservation {
  int keyframe = 0;
  int camera = 0;
  Eigen::Vector2d z_px = Eigen::Vector2d::Zero();
};

// One landmark within one partition. A landmark observed in several partitions
// has a track, and later a variable, in each; so may distant parts of it within
// one partition (map_sharing.h).
struct Track {
  std::uint64_t id = 0;
  std::vector<TrackObservation> observations = {};  // by (keyframe, camera)
  // Begins of the pieces that are distant from the previous one, or in another
  // chain: indices into the observations, ascending, above zero.
  std::vector<int> later_pieces = {};
};

// Index of the piece that contains an observation.
int PieceOf(const Track& track, int observation);

// The samples of an IMU that cover the time between two keyframes.
struct InertialLink {
  int before = 0;
  int after = 0;
  std::span<const ImuSample> samples;  // of the segment, which must outlive it
  int imu = 0;
};

// Two consecutive remaining keyframes of one session, with removed keyframes
// between them: the biases of the first IMU walk from one to the other. Those
// of a second one are not linked.
struct BiasLink {
  int before = 0;
  int after = 0;
  Eigen::Matrix<double, 6, 1> sigmas;  // BiasWalkSigmas
};

struct CalibrationProblem {
  // States as the SLAM system estimated them, with the motion of a second IMU
  // as StartSecondImu begins it.
  std::vector<KeyframeState> keyframes;
  // One for each keyframe. The samples are those of its segment, which must
  // outlive them.
  std::vector<KeyframeContext> contexts;
  // First keyframe of each set of chains that share landmarks: holds the gauge.
  std::vector<int> gauge_keyframes;
  // First keyframe of each chain of inertial links.
  std::vector<int> chain_starts;
  // Temperature of each chain [deg C]: the mean of its segments.
  std::vector<double> chain_temperatures_c;
  std::vector<InertialLink> inertial_links;  // of both IMUs
  std::vector<BiasLink> bias_links;
  std::vector<Track> tracks;  // by (partition, id, time)
};

// The samples that cover the time from t0_ns to t1_ns, and on either side those
// that determine the motion within it (sampling.h).
std::span<const ImuSample> SamplesBetween(std::span<const ImuSample> imu,
                                          std::int64_t t0_ns,
                                          std::int64_t t1_ns);

// Segments in the order of SortByKey. They must outlive the result.
CalibrationProblem FlattenSegments(
    const Rig& rig,
    const std::vector<const MotionSegment*>& segments,
    const Partitioning& partitioning,
    const SharingLimits& limits = {});

// The motions about all keyframes at an estimate.
void MeasureMotions(const Rig& rig,
                    const Calibration& theta,
                    const CalibrationProblem& problem,
                    std::span<const KeyframeState> keyframes,
                    KeyframeMotions* motions);

// theta = reference [+] d, and the states of all keyframes.
struct CalibrationEstimate {
  Eigen::VectorXd d;
  std::vector<KeyframeState> keyframes;
};

}  // namespace selfcal
