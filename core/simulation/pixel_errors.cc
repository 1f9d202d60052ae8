#include "core/simulation/pixel_errors.h"

#include <cmath>
#include <cstddef>

#include "core/simulation/streams.h"

namespace selfcal {
namespace {

// Largest scale of the errors of a track, in sigmas: the checks of a tracker
// end patches that are worse.
constexpr double kLargestScale = 50;

}  // namespace

PixelErrors::PixelErrors(double pixel_sigma_px,
                         int cameras,
                         const SimulationOptions& options)
    : options_(options),
      pixel_sigma_px_(options.noise ? pixel_sigma_px : 0),
      noise_(options.seed, kPixelNoiseStream),
      patches_(options.seed, kPatchStream),
      tracks_(cameras) {}

Eigen::Vector2d PixelErrors::Next(int camera,
                                  int landmark,
                                  int keyframe,
                                  bool is_first_of_landmark) {
  std::vector<Track>& tracks = tracks_[camera];
  const auto index = static_cast<std::size_t>(landmark);
  if (tracks.size() <= index) tracks.resize(index + 1);
  return pixel_sigma_px_ *
         InSigmas(&tracks[index], keyframe, is_first_of_landmark);
}

Eigen::Vector2d PixelErrors::InSigmas(Track* track,
                                      int keyframe,
                                      bool is_first_of_landmark) {
  const double dx = noise_.Normal();
  const double dy = noise_.Normal();
  const Eigen::Vector2d drawn(dx, dy);
  if (track->keyframe == keyframe - 1) {
    const double rho = options_.pixel_correlation;
    track->drift = rho * track->drift + std::sqrt(1 - rho * rho) * drawn;
  } else {
    track->drift = drawn;
    DrawPatch(track);
  }
  track->keyframe = keyframe;
  if (options_.pixel_shared == 0) return track->scale * track->drift;
  if (is_first_of_landmark) return Eigen::Vector2d::Zero();
  return track->scale * (std::sqrt(options_.pixel_shared) * track->common +
                         std::sqrt(1 - options_.pixel_shared) * track->drift);
}

void PixelErrors::DrawPatch(Track* track) {
  const double dx = patches_.Normal();
  const double dy = patches_.Normal();
  track->common = {dx, dy};
  const double freedom = options_.pixel_freedom;
  if (freedom == 0) return;
  do {
    track->scale = std::sqrt(0.5 * freedom / patches_.Gamma(0.5 * freedom));
  } while (!(track->scale <= kLargestScale));
}

BlurErrors::BlurErrors(const PointViews& closed,
                       const SimulationOptions& options)
    : closed_(closed), options_(options), random_(options.seed, kBlurStream) {}

Eigen::Vector2d BlurErrors::Next(int camera,
                                 int keyframe,
                                 const Eigen::Vector3d& p_G,
                                 const Eigen::Vector2d& z_px) {
  Eigen::Vector2d end_px;
  if (options_.exposure_s <= 0 || !options_.noise ||
      !closed_.Sees(camera, keyframe, p_G, &end_px)) {
    return Eigen::Vector2d::Zero();
  }
  return options_.blur_error * random_.Normal() * (end_px - z_px);
}

}  // namespace selfcal
