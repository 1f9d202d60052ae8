// Joint choices of segments against the tables, at equal number, where one kind
// of motion dominates.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/information/segment_information.h"
#include "core/selection/baselines.h"
#include "core/selection/joint_selection.h"
#include "core/simulation/random.h"
#include "test/evaluation/context.h"
#include "test/evaluation/datasets.h"
#include "test/evaluation/dominated_motion.h"
#include "test/evaluation/estimators.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

constexpr double kRarePart = 0.15;
constexpr int kSelectionTableSize = 4;
constexpr std::uint64_t kTrackStream = 103;

// A kind of data; several datasets of each.
struct SelectionScenario {
  std::string name;
  DominantMotion dominant;
  double revisit_fraction = 0.1;
  // Of the error that all observations of a landmark have in common.
  double track_sigma_px = 0;
};

const std::vector<SelectionScenario>& Scenarios() {
  static const std::vector<SelectionScenario> all = {
      {"one axis", DominantMotion::kOneAxis},
      {"calm", DominantMotion::kCalm},
      {"rotation only", DominantMotion::kRotationOnly},
      {"one axis, one place", DominantMotion::kOneAxis, 0.7, 0.8},
  };
  return all;
}

// What real tracks have: the patch of the image is not quite the landmark.
void AddTrackErrors(double sigma_px,
                    std::uint64_t seed,
                    std::vector<MotionSegment>* segments) {
  for (MotionSegment& segment : *segments) {
    for (Observation& o : segment.observations) {
      const std::uint64_t id = segment.landmarks[o.landmark].id;
      Random random(LandmarkHash(id) + seed, kTrackStream);
      const double x = random.Normal();
      const double y = random.Normal();
      o.z_px += sigma_px * Eigen::Vector2d(x, y);
    }
  }
}

struct Data {
  Rig rig;
  Calibration truth;
  std::vector<MotionSegment> segments;
  std::vector<SegmentInformation> information;
  std::vector<ScoredSegment> scored;
  std::vector<Candidate> candidates;
};

Data MakeData(const SelectionScenario& scenario, double duration_s, int index) {
  Data data;
  const auto seed = static_cast<std::uint64_t>(index);
  const EvaluatedDevice device = MakeDevice();
  data.truth = device.truth;
  data.rig = device.rig;
  data.rig.factory = PerturbCalibration(device.truth, {}, 500 + seed);
  data.rig.table_size = kSelectionTableSize;
  SimulationOptions options;
  options.seed = 5000 + seed;
  options.revisit_fraction = scenario.revisit_fraction;
  data.segments =
      Simulate(
          data.rig,
          data.truth,
          data.rig.factory,
          *MakeDominated(scenario.dominant, kRarePart, duration_s, 50 + seed),
          "session",
          options)
          .segments;
  // Image borders do not matter here: the segments are not validated.
  if (scenario.track_sigma_px > 0) {
    AddTrackErrors(scenario.track_sigma_px, seed, &data.segments);
  }
  for (const MotionSegment& segment : data.segments) {
    data.information.push_back(
        ScoreSegment(data.rig, data.rig.factory, segment));
  }
  for (std::size_t i = 0; i < data.segments.size(); ++i) {
    const auto sequence = static_cast<std::int64_t>(i);
    const SegmentKey& key = data.segments[i].key;
    data.scored.push_back({key, sequence, &data.information[i]});
    data.candidates.push_back(
        MakeCandidate(data.rig, key, sequence, data.information[i]));
  }
  return data;
}

using Choice = std::vector<int>;

Choice IndicesOf(const std::vector<TableEntry>& entries) {
  Choice choice;
  for (const TableEntry& entry : entries) {
    choice.push_back(static_cast<int>(entry.sequence));
  }
  std::sort(choice.begin(), choice.end());
  return choice;
}

constexpr char kTables[] = "tables";
constexpr char kJointD[] = "joint D";
constexpr char kRandom[] = "random";

// Choices of as many segments as the tables hold, by their names.
std::vector<std::pair<std::string, Choice>> MakeChoices(const Data& data,
                                                        int random_draws) {
  std::vector<std::pair<std::string, Choice>> choices;
  const Choice by_tables =
      IndicesOf(UnionOfTables(MostInformativeTables(data.rig, data.scored)));
  const int size = static_cast<int>(by_tables.size());
  choices.emplace_back(kTables, by_tables);
  const auto joint = [&](const std::string& name,
                         Criterion criterion,
                         bool share_landmarks,
                         bool offline) {
    JointSettings settings = MakeJointSettings(data.rig, criterion);
    settings.capacity = size;
    settings.share_landmarks = share_landmarks;
    choices.emplace_back(name,
                         offline ? SelectGreedily(settings, data.candidates)
                                 : SelectStreaming(settings, data.candidates));
  };
  joint(kJointD, Criterion::kD, true, false);
  joint("joint D, landmarks not shared", Criterion::kD, false, false);
  joint("joint D, all at once", Criterion::kD, true, true);
  joint("joint A", Criterion::kA, true, false);
  joint("joint E", Criterion::kE, true, false);
  choices.emplace_back(
      "single group",
      IndicesOf(SingleGroupTable(data.rig, size, data.scored).entries));
  for (int draw = 0; draw < random_draws; ++draw) {
    choices.emplace_back(
        kRandom,
        IndicesOf(
            RandomTable(
                data.rig, size, static_cast<std::uint64_t>(draw), data.scored)
                .entries));
  }
  return choices;
}

// What a calibration on a choice comes to.
struct SelectionOutcome {
  std::string choice;
  int segments = 0;
  double gain_nats = 0;     // against the prior, by the claimed covariance
  double square_error = 0;  // mean over components, in reference sigmas
  double nees = 0;          // over the number of components
  bool converged = false;
};

SelectionOutcome Evaluate(const Data& data,
                          const std::string& name,
                          const Choice& choice) {
  std::vector<MotionSegment> chosen;
  for (const int i : choice) chosen.push_back(data.segments[i]);
  const CalibrationResult result =
      Calibrate(data.rig, data.rig.factory, chosen, ComparedOptions());
  const std::vector<int> free = FreeComponents(data.rig);
  const Eigen::VectorXd error = BoxMinus(data.truth, result.theta);
  const Eigen::VectorXd prior = PriorSigmas(data.rig)(free).cwiseInverse();
  const Eigen::LLT<Eigen::MatrixXd> normalised(
      prior.asDiagonal() * result.covariance(free, free) * prior.asDiagonal());
  const Eigen::VectorXd in_reference =
      error.cwiseQuotient(ReferenceSigmas(data.rig))(free);
  const auto size = static_cast<double>(free.size());
  SelectionOutcome outcome;
  outcome.choice = name;
  outcome.segments = static_cast<int>(choice.size());
  outcome.gain_nats = -normalised.matrixLLT().diagonal().array().log().sum();
  outcome.square_error = in_reference.squaredNorm() / size;
  outcome.nees = NormalisedSquaredError(error, result.covariance).nees / size;
  outcome.converged = result.status == CalibrateStatus::kConverged;
  return outcome;
}

struct DatasetOutcome {
  int scenario = 0;
  int dataset = 0;
  std::vector<SelectionOutcome> outcomes;

  // Means over those of a name.
  SelectionOutcome Mean(const std::string& choice) const {
    SelectionOutcome mean;
    mean.choice = choice;
    mean.converged = true;
    double count = 0;
    for (const SelectionOutcome& outcome : outcomes) {
      if (outcome.choice != choice) continue;
      ++count;
      mean.segments = outcome.segments;
      mean.gain_nats += outcome.gain_nats;
      mean.square_error += outcome.square_error;
      mean.nees += outcome.nees;
      mean.converged &= outcome.converged;
    }
    mean.gain_nats /= count;
    mean.square_error /= count;
    mean.nees /= count;
    return mean;
  }
};

std::vector<std::string> Names(const DatasetOutcome& outcome) {
  std::vector<std::string> names;
  for (const SelectionOutcome& one : outcome.outcomes) {
    if (std::find(names.begin(), names.end(), one.choice) == names.end()) {
      names.push_back(one.choice);
    }
  }
  return names;
}

double StandardError(const std::vector<double>& values) {
  return values.size() < 2 ? 0
                           : StandardDeviation(values) /
                                 std::sqrt(static_cast<double>(values.size()));
}

constexpr int kAllScenarios = -1;

// One choice against the tables, dataset by dataset.
struct Comparison {
  std::vector<double> segments, gains, errors, nees;
  std::vector<double> gain_differences;  // [nat]
  std::vector<double> log_ratios;        // ln of the mean squared errors
};

Comparison Compare(const std::vector<DatasetOutcome>& all,
                   int scenario,
                   const std::string& choice) {
  Comparison comparison;
  for (const DatasetOutcome& one : all) {
    if (scenario != kAllScenarios && one.scenario != scenario) continue;
    const SelectionOutcome here = one.Mean(choice);
    const SelectionOutcome tables = one.Mean(kTables);
    comparison.segments.push_back(here.segments);
    comparison.gains.push_back(here.gain_nats);
    comparison.errors.push_back(here.square_error);
    comparison.nees.push_back(here.nees);
    comparison.gain_differences.push_back(here.gain_nats - tables.gain_nats);
    comparison.log_ratios.push_back(
        std::log(here.square_error / tables.square_error));
  }
  return comparison;
}

void WriteTables(const std::vector<DatasetOutcome>& all, Context* context) {
  ResultTable each({"scenario",
                    "dataset",
                    "choice",
                    "segments",
                    "gain [nat]",
                    "mean squared error [sigma_ref^2]",
                    "NEES / D",
                    "converged"});
  for (const DatasetOutcome& one : all) {
    for (const SelectionOutcome& outcome : one.outcomes) {
      each.Add({Scenarios()[one.scenario].name,
                static_cast<long>(one.dataset),
                outcome.choice,
                static_cast<long>(outcome.segments),
                outcome.gain_nats,
                outcome.square_error,
                outcome.nees,
                outcome.converged ? "yes" : "no"});
    }
  }
  context->WriteTable("datasets", each);
  ResultTable table({"scenario",
                     "choice",
                     "datasets",
                     "segments",
                     "gain [nat]",
                     "gain over tables [nat]",
                     "standard error [nat]",
                     "rms error [sigma_ref]",
                     "squared error / that of tables",
                     "times or divided by",
                     "NEES / D"});
  const int scenarios = static_cast<int>(Scenarios().size());
  for (int s = 0; s <= scenarios; ++s) {
    const int only = s < scenarios ? s : kAllScenarios;
    for (const std::string& choice : Names(all[0])) {
      const Comparison comparison = Compare(all, only, choice);
      table.Add({s < scenarios ? Scenarios()[s].name : "all",
                 choice,
                 static_cast<long>(comparison.errors.size()),
                 Mean(comparison.segments),
                 Mean(comparison.gains),
                 Mean(comparison.gain_differences),
                 StandardError(comparison.gain_differences),
                 std::sqrt(Mean(comparison.errors)),
                 std::exp(Mean(comparison.log_ratios)),
                 std::exp(StandardError(comparison.log_ratios)),
                 Mean(comparison.nees)});
    }
  }
  context->WriteTable("choices", table);
}

void PlotChoices(const std::vector<DatasetOutcome>& all, Context* context) {
  Plot plot{.title = "Error of a calibration on as many segments",
            .x_label = "choice",
            .y_label = "squared error / that of tables",
            .log_y = true,
            .categories = Names(all[0]),
            .horizontal = {1}};
  for (int s = 0; s < static_cast<int>(Scenarios().size()); ++s) {
    Series series{.label = Scenarios()[s].name, .style = SeriesStyle::kBars};
    for (const std::string& choice : plot.categories) {
      const Comparison comparison = Compare(all, s, choice);
      const double mean = Mean(comparison.log_ratios);
      const double error = StandardError(comparison.log_ratios);
      series.y.push_back(std::exp(mean));
      series.low.push_back(std::exp(mean - error));
      series.high.push_back(std::exp(mean + error));
    }
    plot.series.push_back(series);
  }
  context->WritePlot("choices", plot);
}

}  // namespace

void RunSelection(Context* context) {
  const int datasets = context->quick() ? 1 : 6;
  const int draws = context->quick() ? 1 : 4;
  const double duration_s = context->quick() ? 20.1 : 180.1;
  const int count = datasets * static_cast<int>(Scenarios().size());
  std::vector<DatasetOutcome> all(count);
  context->ForEach(count, [&](int i) {
    DatasetOutcome& one = all[i];
    one.scenario = i / datasets;
    one.dataset = i % datasets;
    const SelectionScenario& scenario = Scenarios()[one.scenario];
    const Data data = MakeData(scenario, duration_s, i);
    for (const auto& [name, choice] : MakeChoices(data, draws)) {
      one.outcomes.push_back(Evaluate(data, name, choice));
    }
    context->Progress(scenario.name + " " + std::to_string(one.dataset));
  });
  WriteTables(all, context);
  PlotChoices(all, context);

  const Comparison joint = Compare(all, kAllScenarios, kJointD);
  const CheckOptions nats{.unit = "nat"};
  context->AtLeast("selection.joint_d_gain_over_tables_least",
                   *std::min_element(joint.gain_differences.begin(),
                                     joint.gain_differences.end()),
                   0,
                   nats);
  // Better beyond doubt: by two standard errors.
  context->AtMost(
      "selection.joint_d_squared_error_of_tables",
      std::exp(Mean(joint.log_ratios) + 2 * StandardError(joint.log_ratios)),
      1);
  const Comparison random = Compare(all, kAllScenarios, kRandom);
  context->AtLeast(
      "selection.random_squared_error_of_tables",
      std::exp(Mean(random.log_ratios) - 2 * StandardError(random.log_ratios)),
      1);
}

}  // namespace selfcal
