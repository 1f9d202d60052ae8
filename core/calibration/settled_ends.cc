#include "core/calibration/settled_ends.h"

#include <Eigen/Cholesky>
#include <cstdint>
#include <optional>
#include <unordered_map>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/calibration/partition.h"
#include "core/calibration/problem.h"
#include "core/calibration/screening.h"
#include "core/calibration/structured_solver.h"
#include "core/calibration/theta_information.h"
#include "core/factor/keyframe_motion.h"
#include "core/information/offset_start.h"

namespace selfcal {
namespace {

// Limit of the rounds, each with a new selection of observations.
constexpr int kMaxSelections = 3;
constexpr int kMaxEndIterations = 10;
// A minimum is accurate enough when an iteration reduces the cost by less [half
// squares]; the selection is final when a round does.
constexpr double kEnoughCost = 0.1;

// States of a SLAM system are good if their velocities are this near to those
// of the minimum [m/s, and a fraction of the velocity]: those of filters, also
// in simulation, are usually within 0.04 m/s and at most 0.12 m/s; with a scale
// error of a third they are 0.2 m/s off for a hand-held device.
constexpr double kSoundVelocity_mps = 0.1;
constexpr double kSoundVelocityPart = 0.1;
// Fixes position and yaw, which no segment determines.
constexpr double kGaugeInformation = 1;

// Iterates until the remaining gain is small. Returns nullopt if the states are
// not determined.
std::optional<SolverOutcome> Settle(const SolverRound& round,
                                    CalibrationEstimate* estimate,
                                    std::vector<ScreenedLandmark>* landmarks) {
  const SolverOutcome outcome =
      SolveRoundByStructure(round, EndBelow(kEnoughCost), estimate, landmarks);
  if (outcome.status == SolverStatus::kFailed) return std::nullopt;
  return outcome;
}

// The segment with these states, and with the refined landmarks.
MotionSegment At(const MotionSegment& segment,
                 const CalibrationProblem& problem,
                 const CalibrationEstimate& estimate,
                 const std::vector<ScreenedLandmark>& landmarks) {
  MotionSegment at = segment;
  at.keyframes = estimate.keyframes;
  std::unordered_map<std::uint64_t, Eigen::Vector3d> positions;
  for (const ScreenedLandmark& landmark : landmarks) {
    positions.emplace(problem.tracks[landmark.track].id,
                      landmark.position.Point());
  }
  for (Landmark& landmark : at.landmarks) {
    const auto found = positions.find(landmark.id);
    if (found != positions.end()) landmark.p_G = found->second;
  }
  return at;
}

}  // namespace

bool IsFarFromMinimum(const SegmentEnds& ends) {
  Eigen::MatrixXd Lambda =
      ends.Lambda.bottomRightCorner<kEndUnknowns, kEndUnknowns>();
  Lambda.diagonal().array() += kGaugeInformation;
  const Eigen::VectorXd step =
      Lambda.ldlt().solve(ends.eta.tail<kEndUnknowns>());
  const auto is_off = [&](const KeyframeState& state, int at) {
    return step.segment<3>(at + kStateVelocity).norm() >
           kSoundVelocity_mps + kSoundVelocityPart * state.v_GI.norm();
  };
  return is_off(ends.first, 0) || is_off(ends.last, kStateTangentSize);
}

MotionSegment SettleSegment(const Rig& rig,
                            const Calibration& theta,
                            const MotionSegment& segment) {
  const std::vector<const MotionSegment*> segments = {&segment};
  const CalibrationProblem problem = FlattenSegments(
      rig,
      segments,
      PartitionSegments(segments, CalibrateOptions().merge_landmarks));
  const Eigen::Index size = TangentSize(theta);
  const Eigen::MatrixXd held(size, 0);
  CalibrationEstimate estimate{Eigen::VectorXd::Zero(size), problem.keyframes};
  KeyframeMotions motions;
  Screening screening;
  for (int i = 0; i < kMaxSelections; ++i) {
    MeasureMotions(rig, theta, problem, estimate.keyframes, &motions);
    screening = ScreenLandmarks(rig,
                                theta,
                                problem,
                                estimate.keyframes,
                                motions,
                                RobustLoss(),
                                i == 0 ? nullptr : &screening);
    RefineOnWhatIsUsed(
        rig, theta, problem, estimate.keyframes, motions, &screening);
    const std::vector<InertialMatrix> whitening = WhitenInertialLinks(
        rig, ChainThetas(theta, problem), problem, estimate.keyframes);
    const SolverRound round = {.rig = rig,
                               .reference = theta,
                               .problem = problem,
                               .motions = motions,
                               .whitening = whitening,
                               .basis = held,
                               .loss = screening.loss,
                               .max_iterations = kMaxEndIterations};
    const auto outcome = Settle(round, &estimate, &screening.landmarks);
    if (!outcome) return segment;
    if (outcome->initial_cost - outcome->final_cost < kEnoughCost) break;
  }
  return At(segment, problem, estimate, screening.landmarks);
}

SegmentEnds SummariseSettledEnds(const Rig& rig,
                                 const Calibration& theta0,
                                 const MotionSegment& segment) {
  const std::optional<OffsetStart> start =
      FindOffsetStart(rig, theta0, segment);
  const Calibration& theta = start ? start->theta : theta0;
  const MotionSegment& used = start ? start->segment : segment;
  SegmentEnds ends = SummariseEnds(rig, theta, used);
  if (!IsFarFromMinimum(ends)) return ends;
  return SummariseEnds(rig, theta, SettleSegment(rig, theta, used));
}

}  // namespace selfcal
