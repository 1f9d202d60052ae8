#include "core/simulation/feature_tracks.h"

#include <cmath>
#include <utility>

#include "core/simulation/pixel_errors.h"
#include "core/simulation/point_views.h"
#include "core/simulation/random.h"
#include "core/simulation/streams.h"

namespace selfcal {
namespace {

// Number of landmarks of the map that are tried before a new one is created.
constexpr int kRevisitAttempts = 30;
// Number of keyframes after which a landmark is out of sight: a track that
// ended does not resume.
constexpr int kRevisitPause = 10;

Eigen::Vector2d RandomPixel(const CameraCalibration& camera, Random* random) {
  const double x = random->Uniform(0, camera.width_px - 1);
  const double y = random->Uniform(0, camera.height_px - 1);
  return {x, y};
}

// The observations of a landmark so far, and its motion.
struct Sighting {
  // The keyframe and the camera of its first observation.
  int created_keyframe = 0;
  int created_camera = 0;
  Eigen::Vector3d velocity_mps = Eigen::Vector3d::Zero();
  int trackers = 0;    // number of cameras that track it
  int last_seen = -1;  // keyframe
  int begun = 0;       // keyframe at which its present track began
};

class Tracker {
 public:
  Tracker(const Calibration& theta,
          double pixel_sigma_px,
          const Exposures& exposures,
          const Exposures& closed,
          const SimulationOptions& options)
      : options_(options),
        views_(theta, exposures, options),
        errors_(pixel_sigma_px, views_.cameras(), options),
        blur_({theta, closed, options}, options),
        random_(options.seed, kTrackStream),
        outliers_(options.seed, kOutlierStream),
        moving_(options.seed, kMovingLandmarkStream),
        tracked_(theta.cameras.size()) {}

  void Step(int keyframe) {
    keyframe_ = keyframe;
    for (int j = 0; j < views_.cameras(); ++j) Continue(j);
    for (int j = 0; j < views_.cameras(); ++j) Refill(j);
  }

  FeatureTracks Take() && { return std::move(tracks_); }

 private:
  // Observes the landmarks again in each camera that tracks them, and ends
  // tracks at random, at the border of the image and beyond the depth range.
  void Continue(int camera) {
    std::vector<int> kept;
    for (const int landmark : tracked_[camera]) {
      const bool continues =
          !random_.Chance(1 / options_.mean_track_length) &&
          keyframe_ - sightings_[landmark].begun < options_.max_track_length;
      if (continues && Observe(camera, landmark)) {
        kept.push_back(landmark);
      } else {
        --sightings_[landmark].trackers;
      }
    }
    tracked_[camera] = std::move(kept);
  }

  void Refill(int camera) {
    // A pixel without a bearing, or a noisy one beyond the border, gives no
    // track: the limit of attempts terminates the loop in any case.
    int attempts = 4 * options_.landmarks_in_view;
    while (static_cast<int>(tracked_[camera].size()) <
               options_.landmarks_in_view &&
           attempts-- > 0) {
      int landmark = -1;
      if (random_.Chance(options_.revisit_fraction)) landmark = Revisit(camera);
      if (landmark < 0) landmark = Create(camera);
      if (landmark >= 0) Begin(camera, landmark);
    }
  }

  // Returns a landmark that no camera tracks and that this camera observes, or
  // -1.
  int Revisit(int camera) {
    if (tracks_.landmarks_G.empty()) return -1;
    for (int attempt = 0; attempt < kRevisitAttempts; ++attempt) {
      const auto landmark =
          static_cast<int>(random_.Index(tracks_.landmarks_G.size()));
      Eigen::Vector2d z_px;
      if (sightings_[landmark].trackers == 0 &&
          keyframe_ - sightings_[landmark].last_seen > kRevisitPause &&
          views_.Sees(
              camera, keyframe_, tracks_.landmarks_G[landmark], &z_px)) {
        return landmark;
      }
    }
    return -1;
  }

  // Creates a landmark at a random pixel, its depth uniform in the logarithm;
  // returns -1 if no point projects to the pixel.
  int Create(int camera) {
    const Eigen::Vector2d z_px = RandomPixel(views_.camera(camera), &random_);
    const double depth_m = options_.min_depth_m *
                           std::pow(options_.max_depth_m / options_.min_depth_m,
                                    random_.Uniform());
    Eigen::Vector3d p_G;
    if (!views_.PointAt(camera, keyframe_, z_px, depth_m, &p_G)) return -1;
    tracks_.landmarks_G.push_back(p_G);
    sightings_.push_back({.created_keyframe = keyframe_,
                          .created_camera = camera,
                          .velocity_mps = DrawVelocity(),
                          .begun = keyframe_});
    return static_cast<int>(tracks_.landmarks_G.size()) - 1;
  }

  // Zero for a landmark at rest.
  Eigen::Vector3d DrawVelocity() {
    if (!moving_.Chance(options_.moving_fraction)) {
      return Eigen::Vector3d::Zero();
    }
    const double x = moving_.Normal();
    const double y = moving_.Normal();
    const double z = moving_.Normal();
    return options_.moving_speed_mps * Eigen::Vector3d(x, y, z).normalized();
  }

  // Begins a track in this camera, and in every other one that observes the
  // landmark and does not have enough.
  void Begin(int camera, int landmark) {
    sightings_[landmark].begun = keyframe_;
    for (int j = 0; j < views_.cameras(); ++j) {
      const bool wants =
          static_cast<int>(tracked_[j].size()) < options_.landmarks_in_view;
      if ((j == camera || wants) && Observe(j, landmark)) {
        tracked_[j].push_back(landmark);
        ++sightings_[landmark].trackers;
      }
    }
  }

  // Adds the observation unless its pixel, before or after noise, is outside.
  bool Observe(int camera, int landmark) {
    const CameraCalibration& c = views_.camera(camera);
    Sighting& sighting = sightings_[landmark];
    const Eigen::Vector3d& start_G = tracks_.landmarks_G[landmark];
    FeatureObservation observation;
    observation.keyframe = keyframe_;
    observation.camera = camera;
    observation.landmark = landmark;
    if (!views_.Sees(camera, keyframe_, start_G, &observation.true_px)) {
      return false;
    }
    const double moved_s =
        (keyframe_ - sighting.created_keyframe) / options_.keyframe_rate_hz;
    const Eigen::Vector3d p_G = start_G + moved_s * sighting.velocity_mps;
    if (!views_.Sees(camera, keyframe_, p_G, &observation.measured_px)) {
      return false;
    }
    const bool is_first = sighting.created_keyframe == keyframe_ &&
                          sighting.created_camera == camera;
    const Eigen::Vector2d error_px =
        errors_.Next(camera, landmark, keyframe_, is_first);
    observation.measured_px +=
        error_px + blur_.Next(camera, keyframe_, p_G, observation.measured_px);
    if (!InsideImage(c, observation.measured_px)) return false;
    const Eigen::Vector2d elsewhere = RandomPixel(c, &outliers_);
    if (outliers_.Chance(options_.outlier_fraction)) {
      observation.measured_px = elsewhere;
    }
    sighting.last_seen = keyframe_;
    tracks_.observations.push_back(observation);
    return true;
  }

  const SimulationOptions& options_;
  PointViews views_;
  PixelErrors errors_;
  BlurErrors blur_;
  Random random_;
  Random outliers_;
  Random moving_;
  int keyframe_ = 0;
  FeatureTracks tracks_;
  std::vector<Sighting> sightings_;        // by landmark
  std::vector<std::vector<int>> tracked_;  // landmarks in each camera
};

}  // namespace

void UseTrackerErrors(SimulationOptions* options) {
  options->pixel_correlation = 0.75;
  options->pixel_shared = 0.62;
  options->pixel_freedom = 1.5;
  options->outlier_fraction = 0.003;
}

FeatureTracks SimulateTracks(const Calibration& theta,
                             double pixel_sigma_px,
                             int keyframes,
                             const Exposures& exposures,
                             const SimulationOptions& options,
                             const Exposures& closed) {
  Tracker tracker(theta, pixel_sigma_px, exposures, closed, options);
  for (int k = 0; k < keyframes; ++k) tracker.Step(k);
  return std::move(tracker).Take();
}

}  // namespace selfcal
