#include "core/calibration/remembered_information.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/information/session_chain.h"

namespace selfcal {
namespace {

constexpr double kReachError = 0.015;

double Reach(const Rig& rig, const Calibration& from, const Calibration& to) {
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd offset =
      BoxMinus(to, from).cwiseQuotient(ReferenceSigmas(rig))(free);
  return std::sqrt(offset.squaredNorm() / static_cast<double>(free.size()));
}

// Time from one segment to the next: within a session by its own clock; between
// sessions, which share no better clock, in whole seconds of the receiver's
// clock.
double SecondsBetween(const JoinedSegment& a, const JoinedSegment& b) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  if (a.ends->key.session == b.ends->key.session) {
    return static_cast<double>(b.ends->first.t_ns - a.ends->first.t_ns) /
           static_cast<double>(kSecond);
  }
  const std::int64_t whole_s = (b.time_ns - a.time_ns) / kSecond;
  return static_cast<double>(whole_s);
}

// A chain that ages between its segments.
class AgeingChain {
 public:
  AgeingChain(const Rig& rig,
              const Calibration& point,
              const Eigen::VectorXd& walk)
      : chain_(rig, point), variance_per_s_(walk.cwiseAbs2()) {}

  void AgeTo(const JoinedSegment& segment) {
    const double dt_s = last_ ? SecondsBetween(*last_, segment) : 0;
    if (dt_s > 0 && variance_per_s_.size() > 0) {
      chain_.Age(dt_s * variance_per_s_);
    }
    last_ = segment;
  }
  void Add(const SegmentEnds& segment, double weight) {
    chain_.Add(segment, weight);
  }
  ThetaInformation Theta() const { return chain_.Theta(); }

 private:
  SessionChain chain_;
  const Eigen::VectorXd variance_per_s_;
  std::optional<JoinedSegment> last_;
};

// Weights of segments, which depend on the order of the calls.
class SegmentWeights {
 public:
  SegmentWeights(const Rig& rig,
                 const Calibration& point,
                 const RememberedOptions& options)
      : rig_(rig),
        point_(point),
        noise_scale_(std::max(1.0, options.noise_scale)) {}

  // Weight of a segment whose linearisation error counts; nullopt if its
  // linearisation point is too far away.
  std::optional<double> Next(const JoinedSegment& segment) {
    const double reach = ReachOf(segment);
    if (!(reach <= kMaxReach)) {
      ++too_far_;
      return std::nullopt;
    }
    ++segments_;
    reach_ = std::max(reach_, reach);
    return WeightAt(segment, reach);
  }
  // Weight of a segment that was linearised at the point, as its data allows.
  double WeightOfCalibrated(const JoinedSegment& segment) const {
    return WeightAt(segment, ReachOf(segment));
  }

  int segments() const { return segments_; }
  int too_far() const { return too_far_; }
  double reach() const { return reach_; }

 private:
  double ReachOf(const JoinedSegment& segment) const {
    return Reach(rig_, segment.ends->theta0, point_);
  }
  double WeightAt(const JoinedSegment& segment, double reach) const {
    const double noise = noise_scale_ * std::max(1.0, segment.fit);
    return ReachWeight(std::max(1, segments_), reach) / (noise * noise);
  }

  const Rig& rig_;
  const Calibration& point_;
  const double noise_scale_;
  int segments_ = 0;
  int too_far_ = 0;
  double reach_ = 0;
};

}  // namespace

bool IsTooFar(const Rig& rig,
              const SegmentEnds& ends,
              const Calibration& point) {
  return !(Reach(rig, ends.theta0, point) <= kMaxReach);
}

double ReachWeight(int k, double reach) {
  const double loss = 1 + kReachError * k * std::pow(reach, 4);
  return 1 / (loss * loss);
}

RememberedInformation InformationOfRemembered(
    const Rig& rig,
    const Calibration& point,
    std::span<const JoinedSegment> segments,
    const RememberedOptions& options) {
  SegmentWeights weights(rig, point, options);
  AgeingChain all(rig, point, options.walk);
  AgeingChain with_data(rig, point, options.walk);
  for (const JoinedSegment& segment : segments) {
    const std::optional<double> weight =
        segment.calibrated_on ? weights.WeightOfCalibrated(segment)
                              : weights.Next(segment);
    if (!weight) continue;
    all.AgeTo(segment);
    with_data.AgeTo(segment);
    all.Add(*segment.ends, *weight);
    if (segment.calibrated_on) with_data.Add(*segment.ends, *weight);
  }
  RememberedInformation result;
  result.information = all.Theta();
  const ThetaInformation theirs = with_data.Theta();
  result.information.Lambda -= theirs.Lambda;
  result.information.eta -= theirs.eta;
  result.segments = weights.segments();
  result.left_out = weights.too_far();
  result.reach = weights.reach();
  return result;
}

ThetaInformation InformationOfAll(const Rig& rig,
                                  const Calibration& point,
                                  std::span<const JoinedSegment> segments,
                                  const RememberedOptions& options) {
  SegmentWeights weights(rig, point, options);
  AgeingChain all(rig, point, options.walk);
  for (const JoinedSegment& segment : segments) {
    const std::optional<double> weight = weights.Next(segment);
    if (!weight) continue;
    all.AgeTo(segment);
    all.Add(*segment.ends, *weight);
  }
  return all.Theta();
}

}  // namespace selfcal
