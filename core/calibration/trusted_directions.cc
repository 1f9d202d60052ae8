#include "core/calibration/trusted_directions.h"

#include <Eigen/Core>
#include <cstdint>

#include "core/calibration/linear_range.h"
#include "core/calibration/noise_replica.h"

namespace selfcal {
namespace {

// Replicas with added noise, by which spurious information is detected.
constexpr int kReplicas = 3;
constexpr std::uint64_t kReplicaSeed = 1;

Eigen::MatrixXd NoDirections(const WorkingPoint& point) {
  return Eigen::MatrixXd(point.estimate().d.size(), 0);
}

}  // namespace

std::optional<ThetaSubspace> ReleaseWeakDirections(const WorkingPoint& point) {
  if (point.subspace().held.cols() == 0) return std::nullopt;
  const Eigen::MatrixXd nothing = NoDirections(point);
  const LinearRange range(
      point.Round(nothing), point.estimate(), point.screening().landmarks);
  if (!range.settled()) return std::nullopt;
  return TrustedSubspace(point.rig(), range, kWeakInformation);
}

std::optional<ThetaSubspace> HoldSpuriousDirections(
    const std::vector<const MotionSegment*>& segments,
    const Partitioning& partitioning,
    WorkingPoint* point) {
  const ThetaSubspace& subspace = point->subspace();
  if (subspace.estimated.cols() == 0) return std::nullopt;
  const Eigen::MatrixXd nothing = NoDirections(*point);
  const SolverRound round = point->RoundOfNoise(nothing);
  point->linearised().system.ReleaseMemory();  // each replica has its own
  const Eigen::MatrixXd& Lambda = point->information().Lambda;
  std::vector<Eigen::MatrixXd> under_noise;
  Eigen::MatrixXd spurious = nothing;
  // The first replica usually shows that nothing is spurious.
  for (int i = 0; i < kReplicas && (i == 0 || spurious.cols() > 0); ++i) {
    const auto information = InformationUnderNoise(round,
                                                   segments,
                                                   partitioning,
                                                   point->estimate(),
                                                   point->screening().landmarks,
                                                   point->track_noise_factor(),
                                                   kReplicaSeed + i);
    if (information) under_noise.push_back(*information);
    spurious = FindSpurious(point->rig(),
                            subspace,
                            Lambda,
                            under_noise,
                            i + 1 < kReplicas ? kMaybeSpurious : kSpurious);
  }
  if (spurious.cols() == 0) return std::nullopt;
  Eigen::MatrixXd held(spurious.rows(), subspace.held.cols() + spurious.cols());
  held << subspace.held, spurious;
  return HoldDirections(point->rig(), Lambda, held);
}

}  // namespace selfcal
