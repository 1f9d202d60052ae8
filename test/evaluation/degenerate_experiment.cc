// Motions that do not show all of theta: is what they do not show held, is all
// else estimated as well as if that were known, and does no sigma claim more
// than the error keeps to?
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/model/symmetric_eigen.h"
#include "core/simulation/simulate.h"
#include "test/core/information/simple_motions.h"
#include "test/evaluation/context.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

struct DegenerateMotion {
  MotionKind kind;
  const char* name;
};
constexpr DegenerateMotion kMotions[] = {
    {MotionKind::kRest, "rest"},
    {MotionKind::kConstantVelocity, "constant_velocity"},
    {MotionKind::kOneAxis, "one_axis"},
    {MotionKind::kRotationOnly, "rotation_only"},
    {MotionKind::kPlanar, "planar"},
    {MotionKind::kHover, "hover"},
    {MotionKind::kHandheld, "hand_held"},
};

struct DegenerateRun {
  bool refused = false;  // not converged
  int rank = 0;
  double nees = 0;       // of the estimated directions
  double largest_z = 0;  // over all components
  // Root mean square error of the estimated directions in their sigmas, and
  // the same of a run that knows what is held.
  double error = 0, error_if_known = 0;
  std::vector<std::string> held;  // the main part of each direction
};

DegenerateRun RunOne(const DegenerateMotion& motion, std::uint64_t seed) {
  std::mt19937 random(
      static_cast<unsigned>(seed * 100 + static_cast<int>(motion.kind)));
  Rig rig = HandheldRig("simulated");
  const Calibration truth = rig.factory;
  rig.factory = PerturbCalibration(truth, {}, seed);
  SimulationOptions options;
  options.seed = seed;
  options.keyframes_per_segment = 20;
  options.landmarks_in_view = 80;
  const auto segments = Simulate(rig,
                                 truth,
                                 rig.factory,
                                 *RandomMotion(motion.kind, 6.5, &random),
                                 "session",
                                 options)
                            .segments;
  const CalibrationResult result = Calibrate(rig, rig.factory, segments);
  // What is held stays where a calibration starts from: here, at the truth.
  const CalibrationResult known = Calibrate(rig, truth, segments);
  DegenerateRun run;
  run.refused = result.status != CalibrateStatus::kConverged;
  if (run.refused) return run;
  run.rank = result.rank;
  for (const UnobservedDirection& direction : result.held_constant) {
    run.held.push_back(direction.parts.front().component);
  }
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd sigmas = PriorSigmas(rig)(free);
  const auto in_prior = [&](const Calibration& theta) -> Eigen::VectorXd {
    return Eigen::VectorXd(BoxMinus(theta, truth)(free)).cwiseQuotient(sigmas);
  };
  const Eigen::MatrixXd covariance = sigmas.cwiseInverse().asDiagonal() *
                                     result.covariance(free, free) *
                                     sigmas.cwiseInverse().asDiagonal();
  const Eigen::VectorXd error = in_prior(result.theta);
  run.largest_z = error.cwiseAbs()
                      .cwiseQuotient(covariance.diagonal().cwiseSqrt())
                      .maxCoeff();
  // What is held has the variance of the prior, 1, and comes last.
  const SymmetricEigen eigen(covariance);
  const auto squares = [&](const Eigen::VectorXd& of) {
    const Eigen::VectorXd along =
        eigen.eigenvectors().leftCols(run.rank).transpose() * of;
    return along.cwiseAbs2()
        .cwiseQuotient(eigen.eigenvalues().head(run.rank))
        .sum();
  };
  run.nees = squares(error);
  run.error = std::sqrt(run.nees / std::max(1, run.rank));
  run.error_if_known =
      std::sqrt(squares(in_prior(known.theta)) / std::max(1, run.rank));
  return run;
}

// Over the runs of a motion that were not refused.
struct DegenerateSummary {
  int refused = 0;
  int degrees = 0;
  double mean_rank = 0;
  double nees_per_degree = 0;
  double largest_z = 0;
  double error_ratio = 1;
  std::map<std::string, int> held;
};

DegenerateSummary Summarise(const std::vector<DegenerateRun>& runs) {
  DegenerateSummary summary;
  double nees = 0;
  std::vector<double> errors, errors_if_known;
  for (const DegenerateRun& run : runs) {
    summary.refused += run.refused;
    if (run.refused) continue;
    summary.degrees += run.rank;
    summary.largest_z = std::max(summary.largest_z, run.largest_z);
    nees += run.nees;
    errors.push_back(run.error);
    errors_if_known.push_back(run.error_if_known);
    std::map<std::string, int> once;
    for (const std::string& name : run.held) once[name] = 1;
    for (const auto& [name, one] : once) summary.held[name] += one;
  }
  const double count =
      std::max(1.0, static_cast<double>(runs.size()) - summary.refused);
  summary.mean_rank = summary.degrees / count;
  if (summary.degrees > 0) {
    summary.nees_per_degree = nees / summary.degrees;
    summary.error_ratio = Rms(errors) / Rms(errors_if_known);
  }
  return summary;
}

// Names of what is held in more than half of the runs, and of what in fewer.
std::string Names(const DegenerateSummary& summary, int runs, bool often) {
  std::string names;
  for (const auto& [name, count] : summary.held) {
    if ((2 * count > runs) != often) continue;
    names += (names.empty() ? "" : " ") + name;
  }
  return names;
}

}  // namespace

void RunDegenerate(Context* context) {
  const int runs = context->quick() ? 1 : 20;
  ResultTable table({"motion",
                     "runs",
                     "refused",
                     "directions estimated, mean",
                     "NEES per degree",
                     "95 % from",
                     "to",
                     "largest |z|",
                     "error against held known"});
  ResultTable held({"motion", "held as a rule", "held at times"});
  Plot plot{.title = "What motions show too little of",
            .y_label = "NEES per estimated direction",
            .horizontal = {1}};
  Series bars{.label = "measured", .style = SeriesStyle::kBars};
  Series bounds{.label = "upper 95 % bound if consistent",
                .style = SeriesStyle::kBars};
  double largest_z = 0;
  int refused = 0;
  for (const DegenerateMotion& motion : kMotions) {
    std::vector<DegenerateRun> all(runs);
    context->ForEach(runs, [&](int i) {
      all[i] = RunOne(motion, static_cast<std::uint64_t>(i) + 1);
    });
    context->Progress(motion.name);
    const DegenerateSummary summary = Summarise(all);
    largest_z = std::max(largest_z, summary.largest_z);
    refused += summary.refused;
    held.Add({motion.name,
              Names(summary, runs - summary.refused, true),
              Names(summary, runs - summary.refused, false)});
    const std::string name = std::string("degenerate.") + motion.name;
    if (summary.degrees == 0) {
      table.Add({motion.name,
                 static_cast<long>(runs),
                 static_cast<long>(summary.refused),
                 summary.mean_rank,
                 {},
                 {},
                 {},
                 summary.largest_z,
                 {}});
      continue;
    }
    const auto [low, high] = NeesBounds(summary.degrees, 1, 0.95);
    table.Add({motion.name,
               static_cast<long>(runs),
               static_cast<long>(summary.refused),
               summary.mean_rank,
               summary.nees_per_degree,
               low / summary.degrees,
               high / summary.degrees,
               summary.largest_z,
               summary.error_ratio});
    plot.categories.push_back(motion.name);
    bars.y.push_back(summary.nees_per_degree);
    bounds.y.push_back(high / summary.degrees);
    context->AtMost(name + ".nees_per_degree", summary.nees_per_degree, 1.5);
    context->AtMost(name + ".nees_per_degree.goal",
                    summary.nees_per_degree,
                    high / summary.degrees);
    context->AtMost(
        name + ".error_against_held_known", summary.error_ratio, 1.2);
  }
  plot.series = {bars, bounds};
  context->WriteTable("motions", table);
  context->WriteTable("held", held);
  context->WritePlot("nees", plot);
  context->AtMost("degenerate.largest_z", largest_z, 5, {.robust = true});
  context->AtMost("degenerate.refused",
                  refused / static_cast<double>(runs * std::size(kMotions)),
                  0.05);
}

}  // namespace selfcal
