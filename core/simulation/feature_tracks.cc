#include "core/simulation/feature_tracks.h"

#include <algorithm>
#include <cmath>

#include "core/simulation/random.h"
#include "core/simulation/streams.h"

namespace selfcal {
namespace {

// Number of landmarks of the map that are tried before a new one is created.
constexpr int kRevisitAttempts = 30;
// Number of keyframes after which a landmark is out of sight: a track that
// ended does not resume.
constexpr int kRevisitPause = 10;
// A tracked landmark may come nearer, or move farther, than the depths of new
// ones by this factor.
constexpr double kDepthSlack = 2;
// A point that keeps up with the rows of a rolling shutter is in many of them:
// it is not observed.
constexpr int kMaxRowIterations = 50;
constexpr double kRowConverged_px = 1e-9;
// Largest scale of the errors of a track, in sigmas: the checks of a tracker
// end patches that are worse.
constexpr double kLargestScale = 50;

bool InsideImage(const CameraCalibration& camera, const Eigen::Vector2d& z_px) {
  return z_px.x() >= 0 && z_px.y() >= 0 && z_px.x() <= camera.width_px - 1 &&
         z_px.y() <= camera.height_px - 1;
}

Eigen::Vector2d RandomPixel(const CameraCalibration& camera, Random* random) {
  const double x = random->Uniform(0, camera.width_px - 1);
  const double y = random->Uniform(0, camera.height_px - 1);
  return {x, y};
}

// Errors of a track in one camera, in sigmas.
struct TrackError {
  int keyframe = -2;  // of the last observation
  Eigen::Vector2d drift = Eigen::Vector2d::Zero();
  Eigen::Vector2d common = Eigen::Vector2d::Zero();
  double scale = 1;
};

// The first observation of a landmark.
struct Birth {
  int keyframe = 0;
  int camera = 0;
};

class Tracker {
 public:
  Tracker(const Calibration& theta,
          double pixel_sigma_px,
          const Exposures& exposures,
          const Exposures& closed,
          const SimulationOptions& options)
      : theta_(theta),
        exposures_(exposures),
        closed_(closed),
        options_(options),
        pixel_sigma_px_(options.noise ? pixel_sigma_px : 0),
        random_(options.seed, kTrackStream),
        noise_(options.seed, kPixelNoiseStream),
        outliers_(options.seed, kOutlierStream),
        moving_(options.seed, kMovingLandmarkStream),
        blur_(options.seed, kBlurStream),
        patches_(options.seed, kPatchStream),
        tracked_(theta.cameras.size()),
        errors_(theta.cameras.size()) {}

  void Step(int keyframe) {
    keyframe_ = keyframe;
    for (int j = 0; j < cameras(); ++j) Continue(j);
    for (int j = 0; j < cameras(); ++j) Refill(j);
  }

  FeatureTracks Take() && { return std::move(tracks_); }

 private:
  int cameras() const { return static_cast<int>(theta_.cameras.size()); }

  // Observes the landmarks again in each camera that tracks them, and ends
  // tracks at random, at the border of the image and beyond the depth range.
  void Continue(int camera) {
    std::vector<int> kept;
    for (const int landmark : tracked_[camera]) {
      const bool continues =
          !random_.Chance(1 / options_.mean_track_length) &&
          keyframe_ - begun_[landmark] < options_.max_track_length;
      if (continues && Observe(camera, landmark)) {
        kept.push_back(landmark);
      } else {
        --trackers_[landmark];
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
      if (trackers_[landmark] == 0 &&
          keyframe_ - last_seen_[landmark] > kRevisitPause &&
          Sees(camera, landmark, &z_px)) {
        return landmark;
      }
    }
    return -1;
  }

  // Creates a landmark at a random pixel, its depth uniform in the logarithm;
  // returns -1 if no point projects to the pixel.
  int Create(int camera) {
    const CameraCalibration& c = theta_.cameras[camera];
    const Eigen::Vector2d z_px = RandomPixel(c, &random_);
    const double depth_m = options_.min_depth_m *
                           std::pow(options_.max_depth_m / options_.min_depth_m,
                                    random_.Uniform());
    Eigen::Vector3d bearing_C;
    if (!Unproject(c, z_px, &bearing_C)) return -1;
    const Eigen::Vector3d p_I =
        c.q_CI.conjugate() * (depth_m * bearing_C - c.p_CI);
    const KeyframeState x = exposures_.At(camera, keyframe_, z_px.y());
    tracks_.landmarks_G.push_back(x.q_GI * p_I + x.p_GI);
    trackers_.push_back(0);
    last_seen_.push_back(-1);
    begun_.push_back(keyframe_);
    made_.push_back({keyframe_, camera});
    velocities_mps_.push_back(DrawVelocity());
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
    begun_[landmark] = keyframe_;
    for (int j = 0; j < cameras(); ++j) {
      const bool wants =
          static_cast<int>(tracked_[j].size()) < options_.landmarks_in_view;
      if ((j == camera || wants) && Observe(j, landmark)) {
        tracked_[j].push_back(landmark);
        ++trackers_[landmark];
      }
    }
  }

  // Computes the true pixel of a landmark. Returns false if the camera does not
  // observe it.
  bool Sees(int camera, int landmark, Eigen::Vector2d* z_px) const {
    return SeesPoint(exposures_, camera, tracks_.landmarks_G[landmark], z_px);
  }

  bool SeesPoint(const Exposures& exposures,
                 int camera,
                 const Eigen::Vector3d& p_G,
                 Eigen::Vector2d* z_px) const {
    const CameraCalibration& c = theta_.cameras[camera];
    double row_px = c.height_px / 2.0;
    // A rolling shutter sees the point in the row at whose exposure it is
    // there.
    for (int i = 0; i < kMaxRowIterations; ++i) {
      const KeyframeState x = exposures.At(camera, keyframe_, row_px);
      const Eigen::Vector3d p_I = x.q_GI.conjugate() * (p_G - x.p_GI);
      const Eigen::Vector3d p_C = c.q_CI * p_I + c.p_CI;
      const double depth_m = p_C.norm();
      if (!(depth_m > options_.min_depth_m / kDepthSlack &&
            depth_m < options_.max_depth_m * kDepthSlack &&
            Project(c, p_C, z_px, nullptr) && InsideImage(c, *z_px))) {
        return false;
      }
      if (!exposures.IsRolling(camera) ||
          std::abs(z_px->y() - row_px) < kRowConverged_px) {
        return true;
      }
      row_px = z_px->y();
    }
    return false;
  }

  // Error of the next pixel of a track, in sigmas: a first-order autoregressive
  // process, and what is common to the track.
  Eigen::Vector2d NextError(int camera, int landmark) {
    std::vector<TrackError>& errors = errors_[camera];
    if (errors.size() < begun_.size()) errors.resize(begun_.size());
    TrackError& track = errors[landmark];
    const double dx = noise_.Normal();
    const double dy = noise_.Normal();
    const Eigen::Vector2d drawn(dx, dy);
    if (track.keyframe == keyframe_ - 1) {
      const double rho = options_.pixel_correlation;
      track.drift = rho * track.drift + std::sqrt(1 - rho * rho) * drawn;
    } else {
      track.drift = drawn;
      DrawPatch(&track);
    }
    track.keyframe = keyframe_;
    if (options_.pixel_shared == 0) return track.scale * track.drift;
    const Birth& made = made_[landmark];
    if (made.keyframe == keyframe_ && made.camera == camera) {
      return Eigen::Vector2d::Zero();
    }
    return track.scale * (std::sqrt(options_.pixel_shared) * track.common +
                          std::sqrt(1 - options_.pixel_shared) * track.drift);
  }

  // What the errors of a new track have in common.
  void DrawPatch(TrackError* track) {
    const double dx = patches_.Normal();
    const double dy = patches_.Normal();
    track->common = {dx, dy};
    const double freedom = options_.pixel_freedom;
    if (freedom == 0) return;
    do {
      track->scale = std::sqrt(0.5 * freedom / patches_.Gamma(0.5 * freedom));
    } while (!(track->scale <= kLargestScale));
  }

  // Error of the pixel of a point that moves in the image during the exposure,
  // along its motion. A point that leaves the image meanwhile is not blurred.
  Eigen::Vector2d BlurError(int camera,
                            const Eigen::Vector3d& p_G,
                            const Eigen::Vector2d& z_px) {
    Eigen::Vector2d end_px;
    if (options_.exposure_s <= 0 || !options_.noise ||
        !SeesPoint(closed_, camera, p_G, &end_px)) {
      return Eigen::Vector2d::Zero();
    }
    return options_.blur_error * blur_.Normal() * (end_px - z_px);
  }

  // Adds the observation unless its pixel, before or after noise, is outside.
  bool Observe(int camera, int landmark) {
    const CameraCalibration& c = theta_.cameras[camera];
    FeatureObservation observation;
    observation.keyframe = keyframe_;
    observation.camera = camera;
    observation.landmark = landmark;
    if (!Sees(camera, landmark, &observation.true_px)) return false;
    const double moved_s =
        (keyframe_ - made_[landmark].keyframe) / options_.keyframe_rate_hz;
    const Eigen::Vector3d p_G =
        tracks_.landmarks_G[landmark] + moved_s * velocities_mps_[landmark];
    if (!SeesPoint(exposures_, camera, p_G, &observation.measured_px)) {
      return false;
    }
    observation.measured_px += pixel_sigma_px_ * NextError(camera, landmark) +
                               BlurError(camera, p_G, observation.measured_px);
    if (!InsideImage(c, observation.measured_px)) return false;
    const Eigen::Vector2d elsewhere = RandomPixel(c, &outliers_);
    if (outliers_.Chance(options_.outlier_fraction)) {
      observation.measured_px = elsewhere;
    }
    last_seen_[landmark] = keyframe_;
    tracks_.observations.push_back(observation);
    return true;
  }

  const Calibration& theta_;
  const Exposures& exposures_;
  const Exposures& closed_;
  const SimulationOptions& options_;
  const double pixel_sigma_px_;
  Random random_;
  Random noise_;
  Random outliers_;
  Random moving_;
  Random blur_;
  Random patches_;
  int keyframe_ = 0;
  FeatureTracks tracks_;
  std::vector<std::vector<int>> tracked_;        // landmarks in each camera
  std::vector<std::vector<TrackError>> errors_;  // of these landmarks
  std::vector<int> trackers_;   // for each landmark: cameras that track it
  std::vector<int> last_seen_;  // for each landmark: keyframe, or -1
  std::vector<int> begun_;      // for each landmark: keyframe
  std::vector<Birth> made_;     // for each landmark
  std::vector<Eigen::Vector3d> velocities_mps_;  // for each landmark
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
