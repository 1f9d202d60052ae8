#include "core/calibration/evicted_prior.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "core/information/session_chain.h"

namespace selfcal {
namespace {

constexpr double kReachError = 0.015;
// In units of the rig's prior: of what they say less about, the evicted
// segments say nothing. Their estimate of it would lie far away, where they
// were not linearised.
constexpr double kLeastInformation = 100;

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

// The part of the information that counts, as a prior about its own estimate.
ThetaPrior AsPrior(const Rig& rig,
                   const Calibration& point,
                   const ThetaInformation& information) {
  const std::vector<int> free = FreeComponents(rig);
  const auto size = static_cast<Eigen::Index>(free.size());
  const Eigen::VectorXd scale = PriorSigmas(rig)(free);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      scale.asDiagonal() * information.Lambda(free, free) * scale.asDiagonal());
  const Eigen::VectorXd eta = eigen.eigenvectors().transpose() *
                              scale.cwiseProduct(information.eta(free));
  Eigen::VectorXd values = Eigen::VectorXd::Zero(size);
  Eigen::VectorXd offset = Eigen::VectorXd::Zero(size);
  for (Eigen::Index i = 0; i < size; ++i) {
    if (!(eigen.eigenvalues()(i) >= kLeastInformation)) continue;
    values(i) = eigen.eigenvalues()(i);
    offset(i) = eta(i) / values(i);
  }
  Eigen::VectorXd d = Eigen::VectorXd::Zero(TangentSize(point));
  d(free) = scale.cwiseProduct(eigen.eigenvectors() * offset);
  const Eigen::MatrixXd root = scale.cwiseInverse().asDiagonal() *
                               eigen.eigenvectors() *
                               values.cwiseSqrt().asDiagonal();
  Eigen::MatrixXd Lambda = Eigen::MatrixXd::Zero(d.size(), d.size());
  Lambda(free, free) = root * root.transpose();
  const Eigen::MatrixXd by_offset = ThetaByOffset(point, d).inverse();
  return {BoxPlus(point, d), by_offset.transpose() * Lambda * by_offset};
}

}  // namespace

double ReachWeight(int k, double reach) {
  const double loss = 1 + kReachError * k * std::pow(reach, 4);
  return 1 / (loss * loss);
}

EvictedPrior PriorOfEvicted(const Rig& rig,
                            const Calibration& point,
                            std::span<const RememberedSegment> segments,
                            const EvictedPriorOptions& options) {
  EvictedPrior result;
  AgeingChain all(rig, point, options.walk);
  AgeingChain with_data(rig, point, options.walk);
  for (const RememberedSegment& segment : segments) {
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
  ThetaInformation beyond = all.Theta();
  const ThetaInformation theirs = with_data.Theta();
  beyond.Lambda -= theirs.Lambda;
  beyond.eta -= theirs.eta;
  result.prior = AsPrior(rig, point, beyond);
  return result;
}

}  // namespace selfcal
