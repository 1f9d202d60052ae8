#include "core/calibration/trusted_directions.h"

#include <Eigen/Core>
#include <cstdint>

#include "core/calibration/linear_range.h"
#include "core/calibration/noise_replica.h"

namespace selfcal {
namespace {

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

SpuriousTest HoldSpuriousDirections(
    const std::vector<const MotionSegment*>& segments,
    const Partitioning& partitioning,
    WorkingPoint* point) {
  const ThetaSubspace& subspace = point->subspace();
  if (subspace.estimated.cols() == 0) return {};
  const Eigen::MatrixXd nothing = NoDirections(*point);
  const SolverRound round = point->RoundOfNoise(nothing);
  point->linearised().system.ReleaseMemory();  // each replica has its own
  const Eigen::MatrixXd& Lambda = point->information().Lambda;
  const auto spurious = FindSpuriousByReplicas(
      point->rig(), subspace, Lambda, [&](std::uint64_t seed) {
        return InformationUnderNoise(round,
                                     segments,
                                     partitioning,
                                     point->estimate(),
                                     point->screening().landmarks,
                                     point->track_noise_factor(),
                                     seed);
      });
  if (!spurious) return {.made = false};
  if (spurious->cols() == 0) return {};
  Eigen::MatrixXd held(spurious->rows(),
                       subspace.held.cols() + spurious->cols());
  held << subspace.held, *spurious;
  return {.remaining = HoldDirections(point->rig(), Lambda, held)};
}

}  // namespace selfcal
