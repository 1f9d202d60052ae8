#include "core/information/inliers.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/elimination/small_cholesky.h"
#include "core/model/median.h"
#include "core/model/temperature.h"

namespace selfcal {
namespace {

constexpr double kManyOutliers = 0.2;
// The first step does nearly everything: with a calibration as inaccurate as a
// factory calibration, it reduces the median residual from 8 px to 2 px.
constexpr int kMaxRobustSteps = 2;
constexpr double kHuberSigmas = 2.0;
// Relative to the distance from the first keyframe that sees the landmark.
constexpr double kDistancePrior = 0.5;
// A step with a smaller expected decrease of chi-square is not worth its cost.
constexpr double kNegligibleDecrease = 1;

bool Projects(double square) { return square >= 0; }

}  // namespace

void InlierSelector::StartLandmarks(const MotionSegment& segment,
                                    const ObservationOrder& order) {
  const std::size_t landmarks = segment.landmarks.size();
  result_.landmarks.resize(landmarks);
  trial_points_.resize(4 * landmarks);
  distance_priors_.assign(landmarks, 0);
  moving_.assign(landmarks, 1);
  sums_.resize(landmarks);
  squares_.resize(segment.observations.size());
  new_squares_.resize(segment.observations.size());
  for (std::size_t m = 0; m < landmarks; ++m) {
    const Eigen::Vector3d& p_G = segment.landmarks[m].p_G;
    result_.landmarks[m] = p_G;
    Eigen::Vector4d::Map(&trial_points_[4 * m]) = p_G.homogeneous();
    const std::span<const int> track = order.Track(static_cast<int>(m));
    if (track.empty()) continue;
    const int first = segment.observations[track.front()].keyframe;
    const double distance_m =
        std::max(1e-3, (p_G - segment.keyframes[first].p_GI).norm());
    const double sigma_m = kDistancePrior * distance_m;
    distance_priors_[m] = 1 / (sigma_m * sigma_m);
  }
}

// Sums and squares of the moving landmarks, at their trial points.
void InlierSelector::Evaluate(const Calibration& theta0,
                              double pixel_sigma_px,
                              const MotionSegment& segment,
                              const KeyframeMotions& motions,
                              const ObservationOrder& order) {
  runs_.Select(segment, order.ByView(), [&](int index) {
    return moving_[segment.observations[index].landmark] != 0;
  });
  trial_sums_.assign(segment.landmarks.size(), LandmarkSums());
  for (const ObservationRuns::Run& run : runs_.runs()) {
    trial_squares_.resize(
        std::max<std::size_t>(trial_squares_.size(), run.end - run.begin));
    kernels_.AddLandmarkSums(runs_.Arrays(run, segment, theta0, motions),
                             trial_points_.data(),
                             pixel_sigma_px,
                             kHuberSigmas,
                             trial_squares_.data(),
                             trial_sums_.data());
    for (int i = run.begin; i < run.end; ++i) {
      new_squares_[runs_.indices()[i]] = trial_squares_[i - run.begin];
    }
  }
}

// Computes the next trial point of each moving landmark. Returns true if there
// is one.
bool InlierSelector::ProposeSteps(const MotionSegment& segment) {
  bool any = false;
  for (std::size_t m = 0; m < moving_.size(); ++m) {
    if (!moving_[m]) continue;
    moving_[m] = 0;
    const LandmarkSums& sums = sums_[m];
    const Eigen::Vector3d& p_G = result_.landmarks[m];
    const double prior = distance_priors_[m];
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j <= i; ++j) H(i, j) = sums.H(i, j);
      H(i, i) += prior;
      g(i) = sums.g(i) + prior * (p_G[i] - segment.landmarks[m].p_G[i]);
    }
    GuardedCholesky<3>(&H);
    const Eigen::Vector3d step =
        -H.transpose().triangularView<Eigen::Upper>().solve(
            H.triangularView<Eigen::Lower>().solve(g));
    if (!step.allFinite() || -step.dot(g) < kNegligibleDecrease) continue;
    Eigen::Vector3d::Map(&trial_points_[4 * m]) = p_G + step;
    moving_[m] = 1;
    any = true;
  }
  return any;
}

// Accepts trial points that are better; the other landmarks stop moving.
void InlierSelector::TakeSteps(const ObservationOrder& order) {
  for (std::size_t m = 0; m < moving_.size(); ++m) {
    if (!moving_[m]) continue;
    const LandmarkSums& here = sums_[m];
    const LandmarkSums& next = trial_sums_[m];
    if (next.projected() < here.projected() ||
        (next.projected() == here.projected() && next.cost() >= here.cost())) {
      moving_[m] = 0;
      continue;
    }
    result_.landmarks[m] = Eigen::Vector3d::Map(&trial_points_[4 * m]);
    sums_[m] = next;
    for (const int index : order.Track(static_cast<int>(m))) {
      squares_[index] = new_squares_[index];
    }
  }
}

// Median of the norms [px]; zero if nothing projects. Only values near the
// median of a sample are sorted, the others are counted.
double InlierSelector::MedianOfProjected() {
  constexpr std::size_t kStep = 29;
  sorted_.clear();
  for (std::size_t i = 0; i < squares_.size(); i += kStep) {
    if (Projects(squares_[i])) sorted_.push_back(squares_[i]);
  }
  double low = 0;
  double high = std::numeric_limits<double>::infinity();
  if (sorted_.size() > 64) {
    const auto quantile = [&](double part) {
      const auto at =
          sorted_.begin() + static_cast<std::ptrdiff_t>(
                                part * static_cast<double>(sorted_.size()));
      std::nth_element(sorted_.begin(), at, sorted_.end());
      return *at;
    };
    low = quantile(0.35);
    high = quantile(0.65);
  }
  for (;;) {
    sorted_.clear();
    std::size_t below = 0, projected = 0;
    for (const double square : squares_) {
      projected += Projects(square);
      below += Projects(square) && square < low;
      if (square >= low && square <= high) sorted_.push_back(square);
    }
    if (projected == 0) return 0;
    const std::size_t middle = projected / 2;
    if (middle >= below && middle < below + sorted_.size()) {
      const auto at =
          sorted_.begin() + static_cast<std::ptrdiff_t>(middle - below);
      std::nth_element(sorted_.begin(), at, sorted_.end());
      return std::sqrt(*at);
    }
    low = 0;
    high = std::numeric_limits<double>::infinity();
  }
}

void InlierSelector::Classify(double gate_px,
                              const MotionSegment& segment,
                              const ObservationOrder& order) {
  ResidualStatistics& statistics = result_.statistics;
  result_.inliers.clear();
  double sum_of_squares = 0;
  for (std::size_t m = 0; m < segment.landmarks.size(); ++m) {
    const std::size_t begin = result_.inliers.size();
    double of_landmark = 0;
    for (const int index : order.Track(static_cast<int>(m))) {
      const double square = squares_[index];
      if (square < 0) {
        ++statistics.not_projectable;
      } else if (!(square <= gate_px * gate_px)) {
        ++statistics.outliers;
      } else {
        result_.inliers.push_back(index);
        of_landmark += square;
      }
    }
    if (result_.inliers.size() < begin + 2) {
      result_.inliers.resize(begin);
      continue;
    }
    ++statistics.landmarks_used;
    sum_of_squares += of_landmark;
  }
  statistics.inliers = static_cast<int>(result_.inliers.size());
  if (statistics.inliers > 0) {
    statistics.reprojection_rms_px =
        std::sqrt(sum_of_squares / statistics.inliers);
  }
}

const InlierSelection& InlierSelector::Select(const Calibration& theta0,
                                              double pixel_sigma_px,
                                              const MotionSegment& segment,
                                              const KeyframeMotions& motions,
                                              const ObservationOrder& order,
                                              const ScoreOptions& options) {
  StartLandmarks(segment, order);
  Evaluate(theta0, pixel_sigma_px, segment, motions, order);
  sums_.swap(trial_sums_);
  squares_.swap(new_squares_);
  for (std::size_t m = 0; m < moving_.size(); ++m) {
    moving_[m] = order.Track(static_cast<int>(m)).size() >= 2;
  }
  for (int i = 0; i < kMaxRobustSteps && ProposeSteps(segment); ++i) {
    Evaluate(theta0, pixel_sigma_px, segment, motions, order);
    TakeSteps(order);
  }

  ResidualStatistics& statistics = result_.statistics;
  statistics.observations = static_cast<int>(segment.observations.size());
  statistics.landmarks = static_cast<int>(segment.landmarks.size());
  statistics.inliers = 0;
  statistics.not_projectable = 0;
  statistics.outliers = 0;
  statistics.landmarks_used = 0;
  statistics.reprojection_rms_px = 0;
  statistics.reprojection_median_px = MedianOfProjected();
  const double gate_px =
      options.outlier_gate *
      std::max(pixel_sigma_px,
               statistics.reprojection_median_px / kMedianOfRayleigh);
  Classify(gate_px, segment, order);
  statistics.many_outliers = statistics.observations - statistics.inliers >
                             kManyOutliers * statistics.observations;
  return result_;
}

InlierSelection SelectInliers(const Rig& rig,
                              const Calibration& theta0,
                              const MotionSegment& segment,
                              const ScoreOptions& options) {
  const SegmentTheta theta_s(theta0, segment);
  ObservationOrder order;
  order.Find(segment, static_cast<int>(theta0.cameras.size()));
  return InlierSelector().Select(*theta_s,
                                 rig.pixel_sigma_px,
                                 segment,
                                 SegmentMotions(rig, *theta_s, segment),
                                 order,
                                 options);
}

}  // namespace selfcal
