// Is each estimator as sure as it says? Many devices with known truth: the
// normalised squared error of theta (NEES), and how often each parameter lies
// within one, two and three of its own sigmas.
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "core/simulation/simulate.h"
#include "test/evaluation/context.h"
#include "test/evaluation/estimators.h"
#include "test/evaluation/information_gain.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

constexpr int kRuns = 100;
constexpr int kQuickRuns = 4;
constexpr double kDuration_s = 40.5;
constexpr double kQuickDuration_s = 16.5;
constexpr int kConsistencyTableSize = 2;
// New tracks of landmarks that were seen before, so that some are split between
// the partitions of a calibration.
constexpr double kFoundAgain = 0.02;
constexpr double kProbability = 0.95;
// Of many parameters some lie outside of 95 %: each is held to this instead.
constexpr double kParameterProbability = 0.999;
constexpr std::uint64_t kConsistencyFirstSeed = 5001;

enum Kind {
  kBatch,
  kInformative,
  kRandom,
  kLeast,
  kSingle,
  kSelected,  // those above choose first, and calibrate then
  kGain = kSelected,
  kKinds
};
constexpr std::array<const char*, kKinds> kConsistencyNames = {
    "batch",
    "informative",
    "random",
    "least",
    "single_group",
    "information_gain"};

// An error in its own sigmas, where the solver converged and no direction of
// theta was held.
struct ConsistencyOutcome {
  std::optional<double> nees;
  Eigen::VectorXd sigmas;
  long segments = 0;
};

struct ConsistencyRun {
  std::array<ConsistencyOutcome, kKinds> outcomes;
};

ConsistencyOutcome Compare(const CalibrationResult& result,
                           const Calibration& truth,
                           const std::vector<int>& free) {
  ConsistencyOutcome outcome;
  outcome.segments = result.segments;
  if (result.status == CalibrateStatus::kConverged &&
      result.held_constant.empty()) {
    const Eigen::VectorXd error = BoxMinus(result.theta, truth);
    outcome.nees = NormalisedSquaredError(error, result.covariance).nees;
    outcome.sigmas =
        error.cwiseQuotient(result.covariance.diagonal().cwiseSqrt())(free);
  }
  return outcome;
}

// Each run has another device, motion and noise.
ConsistencyRun RunDevice(std::uint64_t seed, double duration_s) {
  Rig rig = HandheldRig("consistency");
  const Calibration truth = rig.factory;
  rig.factory = PerturbCalibration(truth, {}, seed);
  rig.table_size = kConsistencyTableSize;
  SimulationOptions options;
  options.seed = seed;
  options.revisit_fraction = kFoundAgain;
  const std::vector<MotionSegment> segments =
      Simulate(rig,
               truth,
               rig.factory,
               *MakeMixed(duration_s, seed),
               "session",
               options)
          .segments;
  const std::vector<SegmentInformation> scores = ScoreAll(rig, segments);
  const int count = static_cast<int>(segments.size());
  const SegmentSet informative = MostInformative(rig, scores);
  const int kept = static_cast<int>(informative.size());
  std::array<SegmentSet, kSelected> sets;
  sets[kBatch] = AllSegments(count);
  sets[kInformative] = informative;
  sets[kRandom] = RandomSegments(rig, kept, seed, scores);
  sets[kLeast] = LeastInformative(rig, scores);
  sets[kSingle] = SingleGroup(rig, kept, scores);
  const std::vector<int> free = FreeComponents(rig);
  ConsistencyRun run;
  for (int kind = 0; kind < kSelected; ++kind) {
    const std::vector<MotionSegment> picked = Pick(segments, sets[kind]);
    run.outcomes[kind] = Compare(
        Calibrate(rig, rig.factory, picked, ComparedOptions()), truth, free);
  }
  run.outcomes[kGain] =
      Compare(RunInformationGain(rig, segments, {}).calibration, truth, free);
  return run;
}

// Of one estimator over the runs with an outcome.
struct ConsistencySummary {
  std::vector<double> nees;
  double segments = 0;  // mean over all runs
  // By parameter: runs within 1, 2, 3 sigma, and mean error.
  Eigen::MatrixXi within;
  Eigen::VectorXd mean_sigmas;
};

ConsistencySummary Summarise(const std::vector<ConsistencyRun>& runs,
                             int kind,
                             int parameters) {
  ConsistencySummary summary;
  summary.within = Eigen::MatrixXi::Zero(parameters, 3);
  summary.mean_sigmas = Eigen::VectorXd::Zero(parameters);
  for (const ConsistencyRun& run : runs) {
    const ConsistencyOutcome& outcome = run.outcomes[kind];
    summary.segments += static_cast<double>(outcome.segments) /
                        static_cast<double>(runs.size());
    if (!outcome.nees) continue;
    summary.nees.push_back(*outcome.nees);
    summary.mean_sigmas += outcome.sigmas;
    for (int k = 0; k < 3; ++k) {
      summary.within.col(k).array() +=
          (outcome.sigmas.array().abs() <= k + 1).cast<int>();
    }
  }
  if (!summary.nees.empty()) {
    summary.mean_sigmas /= static_cast<double>(summary.nees.size());
  }
  return summary;
}

// How many parameters are covered more or less often than chance allows.
long OutsideBounds(const ConsistencySummary& summary) {
  long outside = 0;
  for (int k = 0; k < 3; ++k) {
    const auto [low, high] =
        BinomialBounds(static_cast<int>(summary.nees.size()),
                       std::erf((k + 1) / std::sqrt(2.0)),
                       kParameterProbability);
    for (const int hits : summary.within.col(k)) {
      outside += hits < low || hits > high;
    }
  }
  return outside;
}

void AddParameters(const std::string& name,
                   const ConsistencySummary& summary,
                   const std::vector<TangentComponent>& components,
                   ResultTable* table) {
  const auto runs = static_cast<double>(summary.nees.size());
  for (std::size_t i = 0; i < components.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    table->Add({name,
                components[i].name,
                summary.within(row, 0) / runs,
                summary.within(row, 1) / runs,
                summary.within(row, 2) / runs,
                summary.mean_sigmas[row]});
  }
}

void Report(const std::vector<ConsistencyRun>& runs, Context* context) {
  const Rig rig = HandheldRig("consistency");
  std::vector<TangentComponent> components;
  for (const int i : FreeComponents(rig)) {
    components.push_back(TangentComponents(rig.factory)[i]);
  }
  const int parameters = static_cast<int>(components.size());
  ResultTable nees({"estimator",
                    "segments",
                    "runs with an outcome",
                    "mean NEES",
                    "95 % from",
                    "to",
                    "coverages outside 99.9 %"});
  ResultTable coverage({"estimator",
                        "parameter",
                        "within 1 sigma",
                        "within 2 sigma",
                        "within 3 sigma",
                        "mean error [sigma]"});
  Plot plot{.title = "NEES of theta over the runs",
            .x_label = "NEES, 26 dimensions",
            .y_label = "runs"};
  for (int kind = 0; kind < kKinds; ++kind) {
    const ConsistencySummary summary = Summarise(runs, kind, parameters);
    const std::string name = kConsistencyNames[kind];
    const auto count = static_cast<int>(summary.nees.size());
    context->AtLeast("consistency." + name + ".runs_with_outcome",
                     count,
                     0.9 * static_cast<double>(runs.size()),
                     {.unit = "runs"});
    if (count == 0) continue;
    const long outside = OutsideBounds(summary);
    const auto [low, high] = NeesBounds(parameters, count, kProbability);
    const double mean = Mean(summary.nees);
    context->Within("consistency." + name + ".nees_mean", mean, low, high);
    context->AtMost("consistency." + name + ".coverages_outside",
                    static_cast<double>(outside),
                    1,
                    {.unit = "of 78"});
    nees.Add({name,
              summary.segments,
              static_cast<long>(count),
              mean,
              low,
              high,
              outside});
    AddParameters(name, summary, components, &coverage);
    plot.series.push_back(
        {.label = name, .style = SeriesStyle::kHistogram, .x = summary.nees});
  }
  context->WriteTable("nees", nees);
  context->WriteTable("coverage", coverage);
  context->WritePlot("nees", plot);
}

}  // namespace

void RunConsistency(Context* context) {
  const int count = context->quick() ? kQuickRuns : kRuns;
  const double duration_s = context->quick() ? kQuickDuration_s : kDuration_s;
  std::vector<ConsistencyRun> runs(static_cast<std::size_t>(count));
  context->ForEach(count, [&](int i) {
    runs[i] = RunDevice(kConsistencyFirstSeed + static_cast<std::uint64_t>(i),
                        duration_s);
    context->Progress("device " + std::to_string(i + 1));
  });
  Report(runs, context);
}

}  // namespace selfcal
