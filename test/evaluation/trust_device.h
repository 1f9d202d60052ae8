// A device of the experiment on trust, driven as the daemon drives it: a real
// pipeline on a store in a temporary folder, segment after segment in the order
// of arrival, each scored, offered to the tables and followed by the run that
// it triggers before the next one comes. What is judged are the versions that
// became active.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/model/rig.h"
#include "core/model/segment.h"
#include "server/store/store.h"

namespace selfcal {

// What a device sends in one session.
struct TrustSession {
  std::vector<MotionSegment> segments;
  // Of the device in this session, where that is not the truth of the device.
  std::optional<Calibration> truth;
};

struct TrustDevice {
  Rig rig;  // rig.factory is wrong
  // Nothing of a real device: then no version is compared with it.
  std::optional<Calibration> truth;
  Rig sensors;  // as rig, with the true noise
  // The session that begins with another truth than that before; -1: none.
  int changed_session = -1;
  // Sessions in their order; each SLAM process runs on the calibration that is
  // active when it begins. Indices and names of sessions are the callee's.
  std::vector<std::function<TrustSession(const Calibration& theta_slam)>>
      sessions;
};

// How far a version is from truth, in what it claims.
struct TrustError {
  double nees = 0;
  int degrees = 0;
  double probability = 1;  // of a NEES as large or larger by chance
  double sigmas = 0;       // of the component that is furthest off
  std::string component;   // that one
};

TrustError ErrorAgainst(const Rig& rig,
                        const Calibration& truth,
                        const Calibration& theta,
                        const Eigen::MatrixXd& covariance);

// A component beyond 4.5 sigma, or a NEES beyond its 99.99 % bound.
bool IsFailure(const TrustError& error);

struct TrustVersion {
  server::StoredCalibration stored;
  bool became_active = false;
  int after_segment = 0;  // segments sent when it was there
  // Against truth as it was then.
  std::optional<TrustError> error;
};

struct TrustOutcome {
  std::vector<TrustVersion> versions;  // without the factory's, oldest first
  std::vector<std::string> failed_runs;
  int segments = 0;
  // After which segments a change of the device was detected.
  std::vector<int> changes;
  // Segments before the session with which the device has changed.
  int before_change = 0;
  // The version that is active in the end, against truth in the end; nothing
  // where that is the factory's, or truth is not known.
  std::optional<TrustError> final_error;
  // Of the versions in use, against truth after each segment: the largest error
  // of a component.
  double largest_sigmas_in_use = 0;
  Calibration final_theta;
  Eigen::MatrixXd final_covariance;
  std::int64_t final_version = 1;
  server::VerdictKind final_verdict = server::VerdictKind::kUnknown;
  double simulation_seconds = 0;
  double pipeline_seconds = 0;
};

// Throws where the store or the pipeline fails, or refuses a segment.
TrustOutcome Drive(const TrustDevice& device);

}  // namespace selfcal
