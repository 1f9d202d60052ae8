#include "core/information/linearisation.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <span>

#include "core/information/weak_priors.h"
#include "core/model/second_imu.h"

namespace selfcal {
namespace {

// Limit for the tracks of a segment (ChainShape): enough for tracks through
// about 650 keyframes, and little beside what a daemon may use.
constexpr std::size_t kMaxTrackBytes = std::size_t{128} << 20;

// The gauge is also a prior: the rest of the problem does not depend on it, so
// any proper prior is equivalent to removing its four directions. This sigma
// keeps the numbers near those of the inertial factors.
constexpr double kGaugeSigma_m = 1e-3;
constexpr double kGaugeSigma_rad = 1e-3;

double Information(double sigma) { return 1 / (sigma * sigma); }

// An end is a copy of the state of a keyframe, equal to it up to errors that
// are small relative to the uncertainty of the link to the next keyframe.
constexpr double kEndTieRotation_rad = 1e-6;
constexpr double kEndTiePosition_m = 1e-6;
constexpr double kEndTieVelocity_mps = 1e-5;
constexpr double kEndTieAccelBias_mps2 = 1e-5;
constexpr double kEndTieGyroBias_radps = 1e-7;

ChainStateVector EndTies() {
  ChainStateVector information(kChainStateSize);
  const auto set = [&](int at, double sigma) {
    information.segment<3>(at).setConstant(Information(sigma));
  };
  set(kStateRotation, kEndTieRotation_rad);
  set(kStatePosition, kEndTiePosition_m);
  set(kStateVelocity, kEndTieVelocity_mps);
  set(kStateAccelBias, kEndTieAccelBias_mps2);
  set(kStateGyroBias, kEndTieGyroBias_radps);
  return information;
}

void FindInertialRms(const LinkTransitions& transitions,
                     int imu,
                     std::vector<double>* rms) {
  rms->assign(kStateKinds, 0);
  for (std::size_t i = 0; i < transitions.size(); ++i) {
    const std::span<const double> whitened = transitions.Whitened(i, imu);
    for (int j = 0; j < kStateTangentSize; ++j) {
      (*rms)[j / 3] += whitened[j] * whitened[j];
    }
  }
  for (double& sum : *rms) {
    sum = std::sqrt(sum / (3.0 * static_cast<double>(transitions.size())));
  }
}

}  // namespace

ChainStateMatrix MotionPrior(int size) {
  ChainStateVector prior = ChainStateVector::Zero(size);
  for (int motion = 0; motion + kStateTangentSize <= size;
       motion += kMotionTangentSize) {
    prior.segment<3>(motion + kStateVelocity)
        .setConstant(Information(kVelocityPriorSigma_mps));
    prior.segment<3>(motion + kStateAccelBias)
        .setConstant(Information(kAccelBiasPriorSigma_mps2));
    prior.segment<3>(motion + kStateGyroBias)
        .setConstant(Information(kGyroBiasPriorSigma_radps));
  }
  return prior.asDiagonal();
}

// Holds position and rotation about gravity; constrains the tilt weakly.
ChainStateMatrix GaugePrior(const KeyframeState& x, int size) {
  ChainStateMatrix prior = ChainStateMatrix::Zero(size, size);
  const Eigen::Matrix3d R_IG = x.q_GI.toRotationMatrix().transpose();
  const double tilt = Information(kTiltPriorSigma_rad);
  const Eigen::Vector3d rotation_G(tilt, tilt, Information(kGaugeSigma_rad));
  prior.block<3, 3>(kStateRotation, kStateRotation) =
      R_IG * rotation_G.asDiagonal() * R_IG.transpose();
  prior.diagonal()
      .segment<3>(kStatePosition)
      .setConstant(Information(kGaugeSigma_m));
  return prior;
}

// Calls use(run, arrays, rows) for the rows of each keyframe and camera, while
// they are in the cache.
template <typename Use>
void SegmentLineariser::LineariseViews(const Rig& rig,
                                       const Calibration& theta0,
                                       const MotionSegment& segment,
                                       const KeyframeMotions& motions,
                                       const Use& use) {
  for (const ObservationRuns::Run& run : inliers_.runs().runs()) {
    // The kernels may write a whole vector past the last element.
    const std::size_t rows = 2 * (run.end - run.begin + kPanelPad);
    const std::size_t size = rows * RowsOf(theta0.cameras[run.camera]).stride();
    if (rows_.size() < size) rows_.resize(size);
    const ObservationRun arrays =
        inliers_.runs().Arrays(run, segment, theta0, motions);
    reprojection_.Linearise(
        arrays, inliers_.points(), rig.pixel_sigma_px, nullptr, rows_.data());
    use(run, arrays, rows_.data());
  }
}

void SegmentLineariser::LineariseLinks(const Rig& rig,
                                       const Calibration& theta0,
                                       const MotionSegment& segment) {
  const std::span<const ImuSample> samples[kMaxImus] = {
      SamplesFromFirstKeyframe(segment),
      SecondSamplesFromFirstKeyframe(segment)};
  for (int imu = 0; imu < ImuCount(theta0); ++imu) {
    links_[imu].clear();
    for (std::size_t k = 0; k + 1 < segment.keyframes.size(); ++k) {
      links_[imu].push_back(
          {&segment.keyframes[k], &segment.keyframes[k + 1], samples[imu]});
    }
  }
  inertial_.Linearise(links_, theta0, rig, &transitions_);
  result_.second_inertial_rms.clear();
  FindInertialRms(transitions_, 0, &result_.inertial_rms);
  if (theta0.imu1) {
    FindInertialRms(transitions_, 1, &result_.second_inertial_rms);
  }
}

void SegmentLineariser::LineariseAlone(const Rig& rig,
                                       const Calibration& theta0,
                                       const MotionSegment& segment,
                                       const KeyframeMotions& motions,
                                       const InlierSelection& selection,
                                       const ObservationOrder& order) {
  inliers_.Find(segment, selection, order);
  LineariseViews(rig, theta0, segment, motions, [](const auto&...) {});
  LineariseLinks(rig, theta0, segment);
}

void SegmentLineariser::StartChain(const Rig& rig,
                                   const Calibration& theta0,
                                   const MotionSegment& segment,
                                   const KeyframeMotions& motions,
                                   const InlierSelection& selection,
                                   const ObservationOrder& order,
                                   int kept) {
  cameras_.clear();
  for (const CameraCalibration& camera : theta0.cameras) {
    cameras_.push_back(RowsOf(camera));
  }
  inliers_.Find(segment, selection, order);
  elimination_.Start({.keyframes = static_cast<int>(segment.keyframes.size()),
                      .link_size = LinkTangentSize(theta0),
                      .cameras = cameras_,
                      .tracks = inliers_.tracks(),
                      .track_keyframes = inliers_.keyframes(),
                      .kept = kept,
                      .motion_size = StateTangentSize(theta0) - kChainPoseSize,
                      .max_bytes = kMaxTrackBytes});
  LineariseViews(rig,
                 theta0,
                 segment,
                 motions,
                 [&](const ObservationRuns::Run& run,
                     const ObservationRun& arrays,
                     const double* rows) {
                   const auto turn = PoseTurn(arrays);
                   elimination_.AddObservations(run.keyframe,
                                                run.camera,
                                                rows,
                                                inliers_.FactorsOf(run),
                                                turn ? &*turn : nullptr);
                 });
  const Eigen::Matrix3d landmark_prior =
      Information(kLandmarkPriorSigma_m) * Eigen::Matrix3d::Identity();
  for (std::size_t m = 0; m + 1 < inliers_.tracks().size(); ++m) {
    elimination_.AddLandmarkPrior(
        static_cast<int>(m), landmark_prior, Eigen::Vector3d::Zero());
  }
}

const LinearisedSegment& SegmentLineariser::Eliminate(
    const Rig& rig,
    const Calibration& theta0,
    const MotionSegment& segment,
    const KeyframeMotions& motions,
    const InlierSelection& selection,
    const ObservationOrder& order,
    int gauge_keyframe) {
  StartChain(rig, theta0, segment, motions, selection, order, 0);
  LineariseLinks(rig, theta0, segment);
  const int keyframes = static_cast<int>(segment.keyframes.size());
  for (int k = 0; k < keyframes; ++k) {
    const int size = StateTangentSize(theta0);
    if (k == 0) elimination_.AddPrior(MotionPrior(size));
    if (k == gauge_keyframe) {
      elimination_.AddPrior(GaugePrior(segment.keyframes[k], size));
    }
    if (k + 1 < keyframes) elimination_.Advance(transitions_[k]);
  }
  elimination_.Finish(&result_.theta);
  return result_;
}

const LinearisedSegment& SegmentLineariser::EliminateToEnds(
    const Rig& rig,
    const Calibration& theta0,
    const MotionSegment& segment,
    const KeyframeMotions& motions,
    const InlierSelection& selection,
    const ObservationOrder& order) {
  StartChain(
      rig, theta0, segment, motions, selection, order, 2 * kChainStateSize);
  LineariseLinks(rig, theta0, segment);
  const int keyframes = static_cast<int>(segment.keyframes.size());
  if (theta0.imu1) {
    // Only the motion of the second IMU has a prior: no end ties it.
    ChainStateMatrix prior = MotionPrior(kMaxChainStateSize);
    prior.topLeftCorner<kChainStateSize, kChainStateSize>().setZero();
    elimination_.AddPrior(prior);
  }
  elimination_.AddKeptState(0, EndTies());
  for (int k = 0; k + 1 < keyframes; ++k) elimination_.Advance(transitions_[k]);
  elimination_.AddKeptState(kChainStateSize, EndTies());
  elimination_.Finish(&result_.theta);
  return result_;
}

}  // namespace selfcal
