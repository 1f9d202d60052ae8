#include "core/calibration/evicted_information.h"

#include <algorithm>
#include <cmath>

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

// A chain that ages between its segments.
class AgeingChain {
 public:
  AgeingChain(const Rig& rig,
              const Calibration& point,
              const Eigen::VectorXd& walk)
      : chain_(rig, point), variance_per_s_(walk.cwiseAbs2()) {}

  void AgeTo(std::int64_t t_ns) {
    const double dt_s = static_cast<double>(t_ns - t_ns_) * 1e-9;
    if (begun_ && dt_s > 0 && variance_per_s_.size() > 0) {
      chain_.Age(dt_s * variance_per_s_);
    }
    begun_ = true;
    t_ns_ = t_ns;
  }
  void Add(const SegmentEnds& segment, double weight) {
    chain_.Add(segment, weight);
  }
  ThetaInformation Theta() const { return chain_.Theta(); }

 private:
  SessionChain chain_;
  const Eigen::VectorXd variance_per_s_;
  std::int64_t t_ns_ = 0;
  bool begun_ = false;
};

}  // namespace

double ReachWeight(int k, double reach) {
  const double loss = 1 + kReachError * k * std::pow(reach, 4);
  return 1 / (loss * loss);
}

EvictedInformation InformationOfEvicted(const Rig& rig,
                                        const Calibration& point,
                                        std::span<const JoinedSegment> segments,
                                        const EvictedOptions& options) {
  EvictedInformation result;
  AgeingChain all(rig, point, options.walk);
  AgeingChain with_data(rig, point, options.walk);
  for (const JoinedSegment& segment : segments) {
    const double reach = Reach(rig, segment.ends->theta0, point);
    if (!segment.calibrated_on) {
      if (!(reach <= kMaxReach)) {
        ++result.left_out;
        continue;
      }
      ++result.segments;
      result.reach = std::max(result.reach, reach);
    }
    const double noise =
        std::max(1.0, options.noise_factor) * std::max(1.0, segment.fit);
    const double weight =
        ReachWeight(std::max(1, result.segments), reach) / (noise * noise);
    all.AgeTo(segment.time_ns);
    with_data.AgeTo(segment.time_ns);
    all.Add(*segment.ends, weight);
    if (segment.calibrated_on) with_data.Add(*segment.ends, weight);
  }
  result.information = all.Theta();
  const ThetaInformation theirs = with_data.Theta();
  result.information.Lambda -= theirs.Lambda;
  result.information.eta -= theirs.eta;
  return result;
}

}  // namespace selfcal
