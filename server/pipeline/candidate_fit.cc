// How well a candidate fits its data.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/preflight/time_offset.h"
#include "server/pipeline/candidate_checks.h"

namespace selfcal::server {
namespace {

// A noise scale that is hardly determined is still significant if it is this
// many standard deviations off.
constexpr double kOffSigmas = 3;

void CheckObservations(const CheckContext& context,
                       std::vector<ValidationCheck>* checks) {
  const CalibrationResult& result = context.result;
  const double all = static_cast<double>(result.observations) +
                     static_cast<double>(result.observations_dropped);
  const double share = all > 0 ? result.observations / all : 0;
  const double limit = context.limits.min_observations_used;
  std::string failure;
  if (!(share >= limit)) {
    failure = fmt::format(
        "{} of {} observations were used ({:.1f} %, at least {:.0f} % are "
        "required): the result is based on the few that happened to fit. Check "
        "tracks, "
        "landmarks and timestamps of what is sent (selfcal segment preflight).",
        result.observations,
        all,
        100 * share,
        100 * limit);
  }
  AddResult("observations_used", share, limit, failure, checks);
}

void CheckSegments(const CheckContext& context,
                   std::vector<ValidationCheck>* checks) {
  const auto& fits = context.result.segment_fits;
  const double limit = context.limits.min_segments_used;
  if (fits.empty()) {
    AddNotTested("segments_used",
                 limit,
                 "The segments were not tested against each other.",
                 checks);
    return;
  }
  const auto excluded =
      std::count_if(fits.begin(), fits.end(), [](const SegmentFit& fit) {
        return !fit.excluded.empty();
      });
  const auto all = static_cast<double>(fits.size());
  const double share = 1 - static_cast<double>(excluded) / all;
  std::string failure;
  if (!(share >= limit)) {
    failure = fmt::format(
        "{} of {} segments contradict the others; if most do, it is unknown "
        "which of them are right. Check what the SLAM system sends (selfcal "
        "segment preflight), and send new motion.",
        excluded,
        all);
  }
  AddResult("segments_used", share, limit, failure, checks);
}

void CheckPixels(const CheckContext& context,
                 std::vector<ValidationCheck>* checks) {
  const CalibrationResult& result = context.result;
  const double limit = context.limits.max_residual_ratio;
  // Correlated errors along tracks are at least partly a larger sigma.
  const double noise =
      std::max(UsedNoise(result, NoiseKind::kPixel), result.track_noise_factor);
  // An observation has two components.
  const double expected_px =
      std::numbers::sqrt2 * context.rig.pixel_sigma_px * noise;
  const double ratio = result.reprojection_rms_after_px / expected_px;
  std::string failure;
  if (!(ratio <= limit)) {
    failure = fmt::format(
        "The reprojection error of {:.3g} px (rms) is {:.1f} times what the "
        "noise predicts, at most {:.1f} times are plausible: the model does "
        "not explain what was seen. Check the pixel sigma of the rig, the "
        "tracks and the timestamps (selfcal segment preflight).",
        result.reprojection_rms_after_px,
        ratio,
        limit);
  }
  AddResult("pixel_residuals", ratio, limit, failure, checks);
}

std::string SegmentText(const SegmentKey& key) {
  return fmt::format("{}~{}", key.session, key.index);
}

void CheckSegmentResiduals(const CheckContext& context,
                           std::vector<ValidationCheck>* checks) {
  const double limit = context.limits.max_residual_ratio;
  const SegmentFit* worst = nullptr;
  double largest = 0;
  for (const SegmentFit& fit : context.result.segment_fits) {
    if (!fit.excluded.empty()) continue;
    double ratio = std::max(fit.pixel_ratio, fit.inertial_ratio);
    if (!std::isfinite(fit.pixel_ratio + fit.inertial_ratio)) {
      ratio = std::numeric_limits<double>::infinity();
    }
    if (ratio > largest) {
      largest = ratio;
      worst = &fit;
    }
  }
  if (worst == nullptr) {
    AddNotTested("segment_residuals",
                 limit,
                 "The residuals of the segments by sensor were not measured.",
                 checks);
    return;
  }
  std::string failure;
  if (!(largest <= limit)) {
    const bool inertial = worst->inertial_ratio >= worst->pixel_ratio;
    failure = fmt::format(
        "The {} residuals of segment {} are {:.1f} times {}, at most {:.1f} "
        "times are plausible: one sensor contradicts the others. Look at it "
        "(selfcal segment show).",
        inertial ? "inertial" : "pixel",
        SegmentText(worst->key),
        largest,
        inertial ? "those of the median segment"
                 : "what the noise that was used predicts",
        limit);
  }
  AddResult("segment_residuals", largest, limit, failure, checks);
}

// True if the residuals show that the noise is larger than what was used.
bool Contradicts(const NoiseScale& scale, double limit) {
  const double off = std::log(scale.factor / scale.used);
  return off > std::max(std::log(limit), kOffSigmas * scale.log_sigma);
}

std::string NoiseFailure(const CheckContext& context, const NoiseScale& scale) {
  const CandidateLimits& limits = context.limits;
  if (Contradicts(scale, limits.max_noise_ratio)) {
    return fmt::format(
        "The {} noise is {:.2f} times what the rig states (+- {:.0f} %), and "
        "{:.2f} times was used: the sigmas are too small. Compare the noise "
        "that the rig states with the data sheet; it cannot change, so that a "
        "wrong one needs a new rig.",
        NoiseKindName(scale.kind),
        scale.factor,
        100 * scale.log_sigma,
        scale.used);
  }
  const double most = scale.kind == NoiseKind::kPixel ? limits.max_pixel_noise
                                                      : limits.max_imu_noise;
  if (scale.used > most) {
    return fmt::format(
        "The {} noise used is {:.1f} times what the rig states; more than "
        "{:.0f} times cannot be noise: the data, the model, or the noise "
        "stated by the rig is wrong. Check them (selfcal segment preflight, "
        "data sheet).",
        NoiseKindName(scale.kind),
        scale.used,
        most);
  }
  return "";
}

void CheckNoise(const CheckContext& context,
                std::vector<ValidationCheck>* checks) {
  const double limit = context.limits.max_noise_ratio;
  double largest = 0;
  std::string failure;
  std::string not_converged;
  for (const NoiseScale& scale : context.result.noise_scales) {
    if (!scale.converged) {
      not_converged += (not_converged.empty() ? "" : ", ");
      not_converged += NoiseKindName(scale.kind);
    }
    if (scale.determined()) {
      largest = std::max(largest, scale.factor / scale.used);
    }
    if (failure.empty()) failure = NoiseFailure(context, scale);
  }
  if (!failure.empty()) {
    AddResult("noise", largest, limit, failure, checks);
  } else if (context.result.noise_scales.empty()) {
    AddNotTested("noise",
                 limit,
                 "The noise could not be estimated: the sigmas rest on what "
                 "the rig states.",
                 checks);
  } else if (!not_converged.empty()) {
    AddNotTested("noise",
                 limit,
                 fmt::format("The estimate of the noise did not converge ({}): "
                             "the sigmas rest on what was used.",
                             not_converged),
                 checks);
  } else {
    AddResult("noise", largest, limit, "", checks);
  }
}

// True if the time offset of a camera, or that of the second IMU, is estimated.
bool EstimatesTimeOffset(const Rig& rig, int imu) {
  if (imu == 0) return std::ranges::count(EstimatedTimeOffsets(rig), 1) > 0;
  const auto components = TangentComponents(rig.factory);
  return std::ranges::any_of(FreeComponents(rig), [&](int i) {
    return components[i].name == "imu1.time_offset";
  });
}

// True if the finding biases the calibration. Lost, repeated and saturated
// samples are noise in some segments, which their residuals show; a time offset
// does not bias it if it is estimated, or if the candidate explains it: states
// of a SLAM system that ignores a rolling shutter are those of the middle row.
bool Biases(const CheckContext& context, const Finding& finding) {
  switch (finding.kind) {
    case FindingKind::kDroppedSamples:
    case FindingKind::kRepeatedSamples:
    case FindingKind::kSaturation:
      return false;
    case FindingKind::kTimeOffset:
      return !EstimatesTimeOffset(context.rig, finding.imu) &&
             (finding.imu == 1 ||
              !IsStatedOffset(context.result.theta,
                              context.evidence.diagnosis->session_s,
                              finding.value,
                              kLeastTimeOffset_s));
    default:
      return true;
  }
}

void CheckPreflight(const CheckContext& context,
                    std::vector<ValidationCheck>* checks) {
  if (!context.evidence.diagnosis) {
    AddNotTested("preflight",
                 0,
                 "The segments could not be read for the preflight checks.",
                 checks);
    return;
  }
  int biasing = 0;
  std::string failure;
  std::string notes;
  for (const Finding& finding : context.evidence.diagnosis->findings) {
    const bool biases = Biases(context, finding);
    biasing += biases ? 1 : 0;
    std::string* text = biases ? &failure : &notes;
    *text += fmt::format("{}Preflight found {}: {}; {}.",
                         text->empty() ? "" : " ",
                         FindingName(finding.kind),
                         finding.cause,
                         finding.remedy);
  }
  AddResult("preflight", biasing, 0, failure, checks);
  if (failure.empty()) checks->back().sentence = notes;
}

// The effect of the largest bias among those that the segments show for
// certain; null: none.
const AbsentEffect* WorstEffect(const CheckContext& context) {
  const std::vector<AbsentEffect>& effects = *context.evidence.effects;
  const double certain =
      context.limits.min_probability /
      static_cast<double>(std::max(effects.size(), size_t{1}));
  const AbsentEffect* worst = nullptr;
  for (const AbsentEffect& effect : effects) {
    if (!(effect.test.probability < certain)) continue;
    if (worst == nullptr || effect.test.statistic / effect.test.degrees >
                                worst->test.statistic / worst->test.degrees) {
      worst = &effect;
    }
  }
  return worst;
}

void CheckEffects(const CheckContext& context,
                  std::vector<ValidationCheck>* checks) {
  const CandidateLimits& limits = context.limits;
  if (!context.evidence.effects) {
    AddNotTested("effects",
                 limits.max_bias_sigmas,
                 "Effects that the rig does not estimate could not be tested.",
                 checks);
    return;
  }
  const AbsentEffect* worst = WorstEffect(context);
  const double bias = worst == nullptr ? 0 : worst->bias_sigmas;
  std::string sentence;
  if (bias > limits.doubtful_bias_sigmas) {
    sentence = fmt::format(
        "The segments show an effect that the rig does not estimate, most "
        "likely {} (probability {:.1g} without it): it shifts {} by {:.1f} "
        "sigma. Create a rig that estimates it (--block '{}=on').",
        worst->block,
        worst->test.probability,
        worst->component,
        bias,
        worst->block);
  }
  const bool fails = bias > limits.max_bias_sigmas;
  AddResult(
      "effects", bias, limits.max_bias_sigmas, fails ? sentence : "", checks);
  if (!fails) checks->back().sentence = sentence;
}

}  // namespace

std::string EffectOnActive(const CheckContext& context) {
  const StoredCalibration& active = context.evidence.active;
  const AbsentEffect* worst = WorstEffect(context);
  if (!active.run || worst == nullptr) return "";
  const int i = MatchComponents(TangentComponents(context.rig.factory),
                                {worst->component})
                    .front();
  const double bias =
      worst->bias_sigmas *
      std::sqrt(context.result.covariance(i, i) / active.covariance(i, i));
  if (!(bias > context.limits.doubtful_bias_sigmas)) return "";
  return fmt::format(
      "Later segments show an effect that the rig does not estimate, most "
      "likely {}: it shifts {} by {:.1f} sigma of this version. Create a rig "
      "that estimates it (--block '{}=on').",
      worst->block,
      worst->component,
      bias,
      worst->block);
}

void CheckFit(const CheckContext& context,
              std::vector<ValidationCheck>* checks) {
  CheckObservations(context, checks);
  CheckSegments(context, checks);
  CheckPixels(context, checks);
  CheckSegmentResiduals(context, checks);
  CheckNoise(context, checks);
  CheckPreflight(context, checks);
  CheckEffects(context, checks);
}

}  // namespace selfcal::server
