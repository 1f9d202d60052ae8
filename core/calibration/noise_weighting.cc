#include "core/calibration/noise_weighting.h"

#include <algorithm>
#include <optional>

#include "core/calibration/noise_scales.h"
#include "core/calibration/screening.h"
#include "core/calibration/subspace.h"
#include "core/calibration/track_noise.h"
#include "core/model/square.h"

namespace selfcal {
namespace {

// Correlated pixel errors that increase the sigmas of theta by less than this
// fraction are treated as independent.
constexpr double kLeastTrackNoise = 0.05;
constexpr int kMaxReweightings = 4;
// Least ratio of the noise of residuals to that of the weights: below it, most
// residuals would be beyond the begin of the loss as soon as they show any of
// the errors that the least noise of the weights stands for.
constexpr double kLeastResiduals = 0.3;

}  // namespace

bool NoiseWeighting::Reweight() {
  for (int i = 0; descent_->converged(); ++i) {
    if (!WeightByTracks()) return false;
    if (!descent_->converged() || !options_.noise_scales) break;
    EstimateScales();
    if (!options_.reweight_noise || i == kMaxReweightings) break;
    const std::optional<Rig> next =
        selfcal::Reweight(stated_, point_->rig(), scales_);
    if (!next) break;
    point_->WeightByNoise(*next, ResidualsTo(*next));
    if (!descent_->Repeat()) return false;
  }
  return true;
}

bool NoiseWeighting::WeightByTracks() {
  if (!options_.correlated_tracks) return true;
  const Eigen::MatrixXd basis = TangentBasis(point_->rig(), point_->subspace());
  const double factor = TrackNoiseFactor(point_->Round(basis),
                                         point_->linearised(),
                                         point_->estimate(),
                                         point_->screening().landmarks);
  track_noise_ = factor * point_->track_noise_factor();
  if (factor < 1 + kLeastTrackNoise) return true;
  point_->WeightByTracks(track_noise_);
  return descent_->Repeat();
}

double NoiseWeighting::ResidualsTo(const Rig& weights) const {
  for (const NoiseScale& scale : scales_) {
    if (scale.kind != NoiseKind::kPixel || !scale.determined()) continue;
    return std::clamp(
        scale.factor * point_->rig().pixel_sigma_px / weights.pixel_sigma_px,
        kLeastResiduals,
        1.0);
  }
  return 1;
}

void NoiseWeighting::EstimateScales() {
  const Eigen::MatrixXd basis = TangentBasis(point_->rig(), point_->subspace());
  // The noise scales require weights without the track noise.
  std::vector<ScreenedLandmark> landmarks = point_->screening().landmarks;
  ScaleWeights(Square(point_->screening().track_noise_factor), &landmarks);
  // Their estimation has its own linear system.
  point_->linearised().system.ReleaseMemory();
  scales_ = EstimateNoiseScales(stated_,
                                point_->RoundOfNoise(basis),
                                point_->estimate(),
                                landmarks,
                                track_noise_);
}

std::vector<NoiseScale> NoiseWeighting::ScalesOfStated() const {
  std::vector<NoiseScale> scales = scales_;
  for (NoiseScale& scale : scales) {
    scale.used =
        NoiseOf(scale.kind, point_->rig()) / NoiseOf(scale.kind, stated_);
    scale.factor *= scale.used;
  }
  return scales;
}

}  // namespace selfcal
