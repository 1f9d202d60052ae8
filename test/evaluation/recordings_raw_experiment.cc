// Rendered recordings, from images and readings to a calibration, by the steps
// of `selfcal calibrate`: the front end's tracks with their real errors, the
// motion without a SLAM system, and a start of which little is known. Is the
// sigma honest then?
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/odometry/odometry.h"
#include "client/odometry/start.h"
#include "core/calibration/calibrate.h"
#include "core/calibration/theta_prior.h"
#include "test/client/tracking/recording_kinds.h"
#include "test/core/simulation/rigs.h"
#include "test/evaluation/context.h"
#include "test/evaluation/statistics.h"
#include "test/rendering/rendered_source.h"

namespace selfcal {
namespace {

struct RawRecording {
  std::string name;
  RecordingKind kind;
  std::uint64_t seed;
};

RawRecording OfKind(const std::string& kind, std::uint64_t seed) {
  return {kind + "_" + std::to_string(seed), KindNamed(kind), seed};
}

RawRecording OfLens(const std::string& model, std::uint64_t seed) {
  RecordingKind kind;
  for (const DistortionModel one : DistortionModels()) {
    if (model == DistortionName(one)) kind.rig = LensRig(one);
  }
  return {model + "_" + std::to_string(seed), kind, seed};
}

std::vector<RawRecording> AllRecordings() {
  std::vector<RawRecording> all;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    all.push_back(OfKind("mono", seed));
  }
  for (const std::string kind :
       {"stereo", "rolling-30ms", "blur-8ms", "dark", "moving"}) {
    for (std::uint64_t seed = 11; seed <= 12; ++seed) {
      all.push_back(OfKind(kind, seed));
    }
  }
  for (const std::string model :
       {"radial-tangential", "equidistant", "double-sphere"}) {
    for (std::uint64_t seed = 21; seed <= 22; ++seed) {
      all.push_back(OfLens(model, seed));
    }
  }
  return all;
}

// The rig that is calibrated: its start is wrong, with tolerances like it.
Rig StartOf(const Rig& truth) {
  Rig rig = truth;
  rig.factory = WrongStart(truth.factory);
  rig.pixel_sigma_px = 0.5;
  rig.blocks = {{"*.time_offset", true}};
  rig.groups = DefaultGroups(rig.blocks, rig.factory);
  for (std::size_t j = 0; j < rig.factory.cameras.size(); ++j) {
    const std::string camera = "cam" + std::to_string(j);
    const CameraCalibration& theta = rig.factory.cameras[j];
    rig.prior_sigmas.push_back({camera + ".focal.*", 0.05 * theta.f.mean()});
    rig.prior_sigmas.push_back(
        {camera + ".principal.*", 0.02 * theta.width_px});
    rig.prior_sigmas.push_back({camera + ".q_CI.*", 0.05});
    rig.prior_sigmas.push_back({camera + ".p_CI.*", 0.05});
    rig.prior_sigmas.push_back({camera + ".time_offset", 0.05});
  }
  return rig;
}

struct RecordingOutcome {
  CalibrationResult result;
  Eigen::VectorXd error;
  double nees = 0;
  // Squared difference of two halves, normalised; nothing if one of them does
  // not converge.
  std::optional<double> halves;
  int free = 0;
  int segments = 0;
  int failed = 0;
};

CalibrationResult CalibrateOn(const Rig& rig,
                              const std::vector<MotionSegment>& segments) {
  CalibrateOptions options;
  options.prior = FactoryPrior(rig);
  return Calibrate(rig, rig.factory, segments, options);
}

std::optional<RecordingOutcome> RunOne(const RawRecording& raw,
                                       double seconds) {
  const RenderedRecording rendered = Render(raw.kind, seconds, raw.seed);
  Rig rig = StartOf(raw.kind.rig);
  client::RenderedSource source(rendered);
  const auto start = client::FindStart(
      &source,
      rig,
      std::vector<client::UnknownOfCamera>(rig.factory.cameras.size()));
  if (!start.ok()) return std::nullopt;
  rig.factory = start->theta;
  client::Odometry odometry(&source, rig, rig.factory, {.session = raw.name});
  RecordingOutcome outcome;
  std::vector<MotionSegment> segments;
  for (;;) {
    auto next = odometry.Next(rig.factory, 1);
    if (!next.ok() || !*next) break;
    if ((*next)->failure.empty()) {
      segments.push_back(std::move((*next)->segment));
    } else {
      ++outcome.failed;
    }
  }
  if (segments.size() < 2) return std::nullopt;
  outcome.segments = static_cast<int>(segments.size());
  outcome.result = CalibrateOn(rig, segments);
  if (outcome.result.status != CalibrateStatus::kConverged) {
    return std::nullopt;
  }
  outcome.error = BoxMinus(outcome.result.theta, raw.kind.rig.factory);
  outcome.nees =
      NormalisedSquaredError(outcome.error, outcome.result.covariance).nees;
  outcome.free = static_cast<int>(FreeComponents(rig).size());
  const std::size_t half = segments.size() / 2;
  const CalibrationResult first =
      CalibrateOn(rig, {segments.begin(), segments.begin() + half});
  const CalibrationResult second =
      CalibrateOn(rig, {segments.begin() + half, segments.end()});
  if (first.status == CalibrateStatus::kConverged &&
      second.status == CalibrateStatus::kConverged) {
    outcome.halves =
        NormalisedSquaredError(BoxMinus(first.theta, second.theta),
                               first.covariance + second.covariance)
            .nees;
  }
  return outcome;
}

double WorstInSigmas(const RecordingOutcome& outcome) {
  double worst = 0;
  for (int i = 0; i < outcome.error.size(); ++i) {
    const double variance = outcome.result.covariance(i, i);
    if (variance > 0) {
      worst = std::max(worst, std::abs(outcome.error(i)) / std::sqrt(variance));
    }
  }
  return worst;
}

double RmsOf(const RecordingOutcome& outcome,
             const Rig& rig,
             const std::string& pattern) {
  std::vector<double> errors;
  for (const int i :
       MatchComponents(TangentComponents(rig.factory), {pattern})) {
    errors.push_back(outcome.error(i));
  }
  return Rms(errors);
}

}  // namespace

void RunRecordingsRaw(Context* context) {
  const double seconds = context->quick() ? 10 : 20;
  std::vector<RawRecording> all = AllRecordings();
  if (context->quick()) all.resize(1);
  std::vector<std::optional<RecordingOutcome>> outcomes(all.size());
  context->ForEach(static_cast<int>(all.size()), [&](int i) {
    outcomes[i] = RunOne(all[i], seconds);
    context->Progress(all[i].name);
  });
  ResultTable table({"recording",
                     "segments",
                     "not found",
                     "NEES",
                     "expected",
                     "halves",
                     "worst [sigma]",
                     "f [px]",
                     "c [px]",
                     "q_CI [mrad]",
                     "p_CI [mm]",
                     "offset [us]"});
  double within = 0, components = 0, failed = 0, nees = 0, expected = 0;
  double halves = 0, expected_of_halves = 0, halves_failed = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!outcomes[i]) {
      ++failed;
      continue;
    }
    const RecordingOutcome& one = *outcomes[i];
    const Rig& rig = all[i].kind.rig;
    table.Add({all[i].name,
               static_cast<long>(one.segments),
               static_cast<long>(one.failed),
               one.nees,
               static_cast<long>(one.result.rank),
               one.halves ? Cell(*one.halves) : Cell(),
               WorstInSigmas(one),
               RmsOf(one, rig, "*.focal.*"),
               RmsOf(one, rig, "*.principal.*"),
               1e3 * RmsOf(one, rig, "*.q_CI.*"),
               1e3 * RmsOf(one, rig, "*.p_CI.*"),
               1e6 * RmsOf(one, rig, "*.time_offset")});
    for (int c = 0; c < one.error.size(); ++c) {
      const double variance = one.result.covariance(c, c);
      if (variance <= 0) continue;
      ++components;
      if (std::abs(one.error(c)) <= 3 * std::sqrt(variance)) ++within;
    }
    nees += one.nees;
    expected += one.result.rank;
    if (one.halves) {
      halves += *one.halves;
      expected_of_halves += one.result.rank;
    } else {
      ++halves_failed;
    }
  }
  context->WriteTable("recordings_raw", table);
  context->AtMost("recordings_raw.not_calibrated", failed, 0, {.robust = true});
  context->AtMost("recordings_raw.halves_not_converged", halves_failed, 0);
  if (expected == 0 || expected_of_halves == 0) return;
  context->AtLeast("recordings_raw.within_3_sigma", within / components, 0.98);
  // 95 % of a chi-squared distribution with so many degrees of freedom.
  const auto within_bounds =
      [&](const std::string& name, double sum, double degrees) {
        const double spread = 1.96 * std::sqrt(2 / degrees);
        context->Within(name, sum / degrees, 1 - spread, 1 + spread);
      };
  within_bounds("recordings_raw.nees_ratio", nees, expected);
  within_bounds("recordings_raw.halves_ratio", halves, expected_of_halves);
}

}  // namespace selfcal
