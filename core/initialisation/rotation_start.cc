#include "core/initialisation/rotation_start.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

#include "core/initialisation/gyro_rotation.h"
#include "core/initialisation/image_rays.h"
#include "core/initialisation/rotation_refinement.h"
#include "core/initialisation/turn_alignment.h"
#include "core/initialisation/visual_turn.h"

namespace selfcal {
namespace {

// Intervals of images for the search of the offset, in which a rotation is
// nearly uniform; and for the refinement, in which it is large.
constexpr double kShortInterval_s = 0.055;
constexpr double kLongInterval_s = 0.2;
constexpr double kLongFlow_rad = 0.1;
constexpr int kMinPairs = 20;
// Least motion: root mean square of the rate about its mean.
constexpr double kMinSpeed_radps = 0.05;
constexpr double kMinOtherAxes_radps = 0.02;
// Largest sigma of the rotation of an alignment from which a refinement begins.
constexpr double kMaxCoarseSigma_rad = 0.2;
// Largest share of the rotations that an alignment, with a focal length that is
// a guess, and a result leave unexplained.
constexpr double kMaxCoarseShare = 0.75;
constexpr double kMaxShare = 0.5;
// Another offset explains the rotations alike if it leaves hardly more.
constexpr double kLikeRatio = 1.3;
constexpr double kLikeShare = 0.02;
constexpr double kLikeDistance_s = 0.025;
// Largest sigmas of a result.
constexpr double kMaxRotationSigma_rad = 0.05;
constexpr double kMaxTimeOffsetSigma_s = 0.01;
constexpr double kMaxBiasSigma_radps = 0.02;
constexpr double kMaxFocalSigma = 0.1;
// The focal scale of an alignment, and how often it is found.
constexpr double kMaxFocalScale = 3;
constexpr int kFocalRounds = 3;
constexpr std::uint64_t kNoiseSeed = 1;
// Priors of a refinement that hardly restrict it.
constexpr double kFreeRotation_rad = 3;
constexpr double kFreeTimeOffset_s = 1;
constexpr double kFreeBias_radps = 1;

template <typename... Values>
std::string Text(const char* format, Values... values) {
  std::array<char, 400> text;
  std::snprintf(text.data(), text.size(), format, values...);
  return text.data();
}

// Finite samples in order, with times relative to the origin.
std::vector<ImuSample> UsableSamples(std::span<const ImuSample> samples,
                                     std::int64_t origin_ns) {
  std::vector<ImuSample> usable;
  for (ImuSample sample : samples) {
    sample.t_ns -= origin_ns;
    if (!sample.gyro.allFinite() ||
        (!usable.empty() && sample.t_ns <= usable.back().t_ns)) {
      continue;
    }
    usable.push_back(sample);
  }
  return usable;
}

class Finder {
 public:
  Finder(const CameraCalibration& camera,
         const ImuCalibration& imu,
         std::vector<ImuSample> samples,
         RayImages rays,
         const RotationSearch& options)
      : camera_(camera),
        imu_(imu),
        options_(options),
        samples_(std::move(samples)),
        rays_(std::move(rays)),
        short_pairs_(ChainPairs(rays_.images(), kShortInterval_s)),
        gyro_(imu),
        first_s_(1e-9 * static_cast<double>(samples_.front().t_ns)),
        last_s_(1e-9 * static_cast<double>(samples_.back().t_ns)) {
    for (const ImuSample& sample : samples_) gyro_.Add(sample);
    if (!options.search_rotation) known_ = camera.q_CI.normalized();
  }

  RotationStartResult Run() {
    if (short_pairs_.size() < kMinPairs) {
      return {std::nullopt,
              Text("too few images with common points: %d pairs of at least %d "
                   "points, %d are needed",
                   static_cast<int>(short_pairs_.size()),
                   kMinMatches,
                   kMinPairs)};
    }
    const std::vector<TurnAlignment> minima =
        SearchOffsets(VisualTurns(rays_, short_pairs_),
                      gyro_,
                      first_s_,
                      last_s_,
                      camera_.time_offset_s,
                      options_.max_time_offset_s,
                      known_);
    const std::string objection = Objection(minima);
    if (!objection.empty()) return {std::nullopt, objection};
    RotationStart start = Refine(CoarseFocalScale(minima.front()));
    const std::string doubt = Objection(start);
    if (!doubt.empty()) return {std::nullopt, doubt};
    return {start, {}};
  }

 private:
  // The reason why there is no start at these offsets; empty if there is one at
  // the first.
  std::string Objection(const std::vector<TurnAlignment>& minima) const {
    const TurnAlignment& best = minima.front();
    if (best.turns < kMinPairs) {
      return Text(
          "too few images within the gyroscope's readings: %d pairs, %d are "
          "needed",
          best.turns,
          kMinPairs);
    }
    if (best.speed_radps < kMinSpeed_radps) {
      return Text(
          "the device hardly turned, or at a constant rate: its angular rate "
          "varies by %.2g rad/s, %.2g are needed",
          best.speed_radps,
          kMinSpeed_radps);
    }
    if (!known_ && (best.other_axes_radps < kMinOtherAxes_radps ||
                    best.rotation_sigma_rad > kMaxCoarseSigma_rad)) {
      return OneAxis(best.other_axes_radps);
    }
    if (best.share > kMaxCoarseShare) {
      return Text(
          "the rotations of the images and of the gyroscope do not agree at "
          "any time offset within %.2g s of %.3g s: at best %.0f %% are left",
          options_.max_time_offset_s,
          camera_.time_offset_s,
          100 * best.share);
    }
    if (BeyondRange(best.offset_s)) return OutOfRange();
    for (const TurnAlignment& other : minima) {
      if (std::abs(other.offset_s - best.offset_s) > kLikeDistance_s &&
          other.share < kLikeRatio * best.share + kLikeShare) {
        return Text(
            "the rotations of images and gyroscope agree at two time offsets, "
            "%.3f and %.3f s: the motion repeats itself",
            best.offset_s,
            other.offset_s);
      }
    }
    return {};
  }

  static std::string OneAxis(double other_axes_radps) {
    return Text(
        "the device turned about one axis only (%.2g rad/s about the others): "
        "turn it about all of them",
        other_axes_radps);
  }

  std::string OutOfRange() const {
    return Text(
        "the time offset is outside %.3g +- %.3g s: search a larger range",
        camera_.time_offset_s,
        options_.max_time_offset_s);
  }

  bool BeyondRange(double offset_s) const {
    return std::abs(offset_s - camera_.time_offset_s) >
           options_.max_time_offset_s;
  }

  // Scales the rays until their rotations are as large as the gyroscope's.
  TurnAlignment CoarseFocalScale(TurnAlignment alignment) {
    if (!options_.estimate_focal_scale) return alignment;
    for (int n = 0; n < kFocalRounds; ++n) {
      focal_scale_ = std::clamp(focal_scale_ * alignment.focal_ratio,
                                1 / kMaxFocalScale,
                                kMaxFocalScale);
      rays_.SetFocalScale(focal_scale_);
      alignment = AlignTurns(VisualTurns(rays_, short_pairs_),
                             gyro_,
                             first_s_,
                             last_s_,
                             alignment.offset_s,
                             known_);
    }
    return alignment;
  }

  RotationStart Refine(const TurnAlignment& alignment) {
    RotationStart begin;
    begin.q_CI = alignment.q_CI;
    begin.time_offset_s = alignment.offset_s;
    begin.b_g = alignment.b_g;
    begin.focal_scale = focal_scale_;
    const StartPrior prior = PriorOf(begin);
    const std::vector<ImagePair> pairs =
        ChainPairs(rays_.images(), kLongInterval_s, kLongFlow_rad);
    const auto refine = [&](const RotationStart& from, RayImages* rays) {
      return RefineRotationStart(from, prior, imu_, samples_, pairs, rays);
    };
    RotationStart start = refine(begin, &rays_);

    // Noise in the directions of translation moves the estimate by its square,
    // most where there is hardly a translation. As much noise of either sign
    // again shows by how much: the linear parts cancel.
    Eigen::Matrix<double, kStartSize, 1> shift;
    shift.setZero();
    for (const double sign : {-1.0, 1.0}) {
      RayImages noisy = rays_;
      noisy.AddNoise(sign * start.residual_px / std::sqrt(2.0), kNoiseSeed);
      shift += BoxMinus(refine(start, &noisy), start) / 2;
    }
    start = BoxPlus(start, -shift);
    start.covariance += shift * shift.transpose();
    start.explained = 1 - AlignTurns(VisualTurns(rays_, short_pairs_),
                                     gyro_,
                                     first_s_,
                                     last_s_,
                                     start.time_offset_s,
                                     start.q_CI)
                              .share;
    return start;
  }

  StartPrior PriorOf(const RotationStart& begin) const {
    StartPrior prior{begin, {}};
    prior.mean.focal_scale = 1;
    prior.sigmas.segment<3>(kStartRotation)
        .setConstant(known_ ? options_.rotation_sigma_rad : kFreeRotation_rad);
    prior.sigmas[kStartTimeOffset] = kFreeTimeOffset_s;
    prior.sigmas.segment<3>(kStartGyroBias).setConstant(kFreeBias_radps);
    prior.sigmas[kStartFocalScale] =
        options_.estimate_focal_scale ? options_.focal_sigma : 0;
    return prior;
  }

  // The reason why a result is none; empty if it is one.
  std::string Objection(const RotationStart& start) const {
    double rotation = 0, bias = 0;
    for (int i = 0; i < 3; ++i) {
      rotation = std::max(rotation, start.Sigma(kStartRotation + i));
      bias = std::max(bias, start.Sigma(kStartGyroBias + i));
    }
    // Comparisons are false for NaN.
    if (!(start.explained >= 1 - kMaxShare)) {
      return Text(
          "the rotations of images and gyroscope do not agree: %.0f %% "
          "are left",
          100 * (1 - start.explained));
    }
    if (BeyondRange(start.time_offset_s)) {
      return OutOfRange();
    }
    if (!(start.Sigma(kStartTimeOffset) <= kMaxTimeOffsetSigma_s)) {
      return Text(
          "the time offset is not determined: its sigma is %.1f ms, "
          "vary the rotation",
          1e3 * start.Sigma(kStartTimeOffset));
    }
    if (!known_ && !(rotation <= kMaxRotationSigma_rad)) {
      return Text(
          "the rotation between camera and gyroscope is not determined: "
          "its sigma is %.2g rad, turn the device about all axes",
          rotation);
    }
    if (!(bias <= kMaxBiasSigma_radps)) {
      return Text(
          "the bias of the gyroscope is not determined: its sigma is "
          "%.2g rad/s, record for longer",
          bias);
    }
    if (!(start.Sigma(kStartFocalScale) <= kMaxFocalSigma)) {
      return Text(
          "the focal length is not determined: its sigma is %.0f %%, "
          "turn the device about the axes across its view",
          100 * start.Sigma(kStartFocalScale));
    }
    return {};
  }

  const CameraCalibration& camera_;
  const ImuCalibration& imu_;
  const RotationSearch options_;
  const std::vector<ImuSample> samples_;
  RayImages rays_;
  const std::vector<ImagePair> short_pairs_;
  GyroRotation gyro_;  // without a bias
  const double first_s_;
  const double last_s_;
  double focal_scale_ = 1;                   // of rays_, before the refinement
  std::optional<Eigen::Quaterniond> known_;  // q_CI
};

}  // namespace

double RotationStart::Sigma(int component) const {
  return std::sqrt(covariance(component, component));
}

RotationStartResult FindRotationStart(const CameraCalibration& camera,
                                      const ImuCalibration& imu,
                                      std::span<const TrackedImage> images,
                                      std::span<const ImuSample> samples,
                                      const RotationSearch& options) {
  const std::int64_t origin_ns = samples.empty() ? 0 : samples.front().t_ns;
  std::vector<ImuSample> usable = UsableSamples(samples, origin_ns);
  if (usable.size() < 2) {
    return {std::nullopt, "there are no readings of the gyroscope"};
  }
  return Finder(camera,
                imu,
                std::move(usable),
                RayImages(camera, images, origin_ns),
                options)
      .Run();
}

}  // namespace selfcal
