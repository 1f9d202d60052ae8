// Does the entropy of a segment find informative ones? Eight segments of lowest
// entropy (over all of theta), of highest, and at random; convergence over the
// updates of the database; and the error of a calibration on each segment alone
// against its entropy.
#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <vector>

#include "test/evaluation/context.h"
#include "test/evaluation/datasets.h"
#include "test/evaluation/estimators.h"
#include "test/evaluation/parameter_statistics.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

enum Choice { kChooseMost, kChooseLeast, kChooseRandom, kChoices };
constexpr const char* kEntropyNames[] = {
    "most informative", "least informative", "random"};

struct Sizes {
  int datasets = kDatasets;
  int converging = 4;    // of them, for the convergence
  int random_draws = 4;  // of each dataset
  int kept = 8;          // segments
  double duration_s = kDatasetDuration_s;
};

// A segment alone.
struct Alone {
  std::vector<double> entropies;  // by group
  std::vector<double> errors;     // by group: rms in sigma_ref
};

struct EntropyDatasetRun {
  std::vector<Estimate> estimates[kChoices];
  long not_converged[kChoices] = {};
  std::vector<Alone> alone;
  // By update of the database: rms over the components of the distance to
  // batch, in sigmas of batch.
  std::vector<double> convergence[kChoices];
};

SegmentSet Choose(Choice choice,
                  const Rig& rig,
                  const std::vector<SegmentInformation>& scores,
                  int kept,
                  std::uint64_t seed) {
  switch (choice) {
    case kChooseMost:
      return SingleGroup(rig, kept, scores);
    case kChooseLeast:
      return LeastOfSingleGroup(rig, kept, scores);
    default:
      return RandomSegments(rig, kept, seed, scores);
  }
}

void EstimateAll(const Dataset& dataset,
                 const std::vector<SegmentInformation>& scores,
                 const Sizes& sizes,
                 EntropyDatasetRun* run) {
  for (const Choice choice : {kChooseMost, kChooseLeast, kChooseRandom}) {
    const int draws = choice == kChooseRandom ? sizes.random_draws : 1;
    for (int draw = 0; draw < draws; ++draw) {
      const SegmentSet set = Choose(choice,
                                    dataset.rig,
                                    scores,
                                    sizes.kept,
                                    static_cast<std::uint64_t>(draw));
      const CalibrationResult result = Calibrate(dataset.rig,
                                                 dataset.rig.factory,
                                                 Pick(dataset.segments(), set),
                                                 ComparedOptions());
      run->not_converged[choice] +=
          result.status != CalibrateStatus::kConverged;
      run->estimates[choice].push_back(
          {result.theta, result.covariance.diagonal().cwiseSqrt()});
    }
  }
}

// The database as it was after each segment, where it changed.
std::vector<SegmentSet> Updates(Choice choice,
                                const Rig& rig,
                                const std::vector<SegmentInformation>& scores,
                                int kept) {
  std::vector<SegmentSet> updates;
  for (std::size_t n = 1; n <= scores.size(); ++n) {
    const std::vector<SegmentInformation> first(
        scores.begin(), scores.begin() + static_cast<std::ptrdiff_t>(n));
    SegmentSet set = Choose(choice, rig, first, kept, 0);
    if (!set.empty() && (updates.empty() || set != updates.back())) {
      updates.push_back(std::move(set));
    }
  }
  return updates;
}

void Converge(const Dataset& dataset,
              const std::vector<SegmentInformation>& scores,
              int kept,
              EntropyDatasetRun* run) {
  const auto count = static_cast<int>(scores.size());
  const CalibrationResult batch =
      CalibrateOn(dataset.rig, dataset.segments(), AllSegments(count));
  const Eigen::VectorXd sigma = batch.covariance.diagonal().cwiseSqrt();
  for (const Choice choice : {kChooseMost, kChooseLeast, kChooseRandom}) {
    Calibration theta = dataset.rig.factory;
    for (const SegmentSet& set : Updates(choice, dataset.rig, scores, kept)) {
      const CalibrationResult result = Calibrate(
          dataset.rig, theta, Pick(dataset.segments(), set), ComparedOptions());
      if (result.status == CalibrateStatus::kConverged) theta = result.theta;
      run->convergence[choice].push_back(
          Rms(Ratios(BoxMinus(theta, batch.theta), sigma)));
    }
  }
}

void CalibrateAlone(const Dataset& dataset,
                    const std::vector<SegmentInformation>& scores,
                    EntropyDatasetRun* run) {
  const Eigen::VectorXd reference = ReferenceSigmas(dataset.rig);
  for (std::size_t i = 0; i < scores.size(); ++i) {
    const CalibrationResult result = Calibrate(dataset.rig,
                                               dataset.rig.factory,
                                               {dataset.segments()[i]},
                                               ComparedOptions());
    if (result.status != CalibrateStatus::kConverged) continue;
    const Eigen::VectorXd error =
        BoxMinus(result.theta, dataset.truth).cwiseQuotient(reference);
    Alone alone;
    for (std::size_t q = 0; q < dataset.rig.groups.size(); ++q) {
      std::vector<double> of_group;
      for (const int c : GroupComponents(dataset.rig, dataset.rig.groups[q])) {
        of_group.push_back(error(c));
      }
      alone.entropies.push_back(scores[i].groups[q].entropy);
      alone.errors.push_back(Rms(of_group));
    }
    run->alone.push_back(std::move(alone));
  }
}

void WriteChoices(const std::vector<EntropyDatasetRun>& runs,
                  Context* context) {
  std::vector<std::pair<std::string, ParameterStatistics>> all;
  ResultTable counts({"choice", "calibrations", "not converged"});
  for (const Choice choice : {kChooseMost, kChooseLeast, kChooseRandom}) {
    std::vector<Estimate> estimates;
    long not_converged = 0;
    for (const EntropyDatasetRun& run : runs) {
      estimates.insert(estimates.end(),
                       run.estimates[choice].begin(),
                       run.estimates[choice].end());
      not_converged += run.not_converged[choice];
    }
    counts.Add({kEntropyNames[choice],
                static_cast<long>(estimates.size()),
                not_converged});
    all.emplace_back(kEntropyNames[choice],
                     Summarise(MakeDevice().truth, estimates));
  }
  context->WriteTable("choices", CompareParameters(MakeDevice().truth, all));
  context->WriteTable("converged", counts);
  const auto error_against_random = [&](Choice choice) {
    return MedianOf(Ratios(all[choice].second.rms_error,
                           all[kChooseRandom].second.rms_error));
  };
  context->AtMost("entropy.error_most_against_random",
                  error_against_random(kChooseMost),
                  1);
  context->AtLeast("entropy.error_least_against_random",
                   error_against_random(kChooseLeast),
                   1);
}

void PlotConvergence(const std::vector<EntropyDatasetRun>& runs,
                     Context* context) {
  Plot plot{.title = "Convergence over the updates of the database",
            .x_label = "update",
            .y_label = "distance to batch, rms [sigma of batch]",
            .log_y = true};
  for (const Choice choice : {kChooseMost, kChooseRandom, kChooseLeast}) {
    Series series{.label = kEntropyNames[choice]};
    std::size_t longest = 0;
    for (const EntropyDatasetRun& run : runs) {
      longest = std::max(longest, run.convergence[choice].size());
    }
    for (std::size_t k = 0; k < longest; ++k) {
      // A database that no longer changes stays where it is.
      std::vector<double> at;
      for (const EntropyDatasetRun& run : runs) {
        const std::vector<double>& one = run.convergence[choice];
        if (!one.empty()) at.push_back(one[std::min(k, one.size() - 1)]);
      }
      series.x.push_back(static_cast<double>(k + 1));
      series.y.push_back(MedianOf(at));
      series.low.push_back(Quantile(at, 0));
      series.high.push_back(Quantile(at, 1));
    }
    plot.series.push_back(series);
  }
  context->WritePlot("convergence", plot);
}

void WriteAlone(const std::vector<EntropyDatasetRun>& runs, Context* context) {
  const std::vector<ParameterGroup> groups = MakeDevice().rig.groups;
  Plot histogram{.title = "Entropies of the segments of all datasets",
                 .x_label = "entropy [nat]",
                 .y_label = "segments",
                 .bins = 40};
  Plot scatter{.title = "A segment's entropy and the calibration on it alone",
               .x_label = "entropy [nat]",
               .y_label = "error, rms over the group [sigma_ref]",
               .log_y = true};
  ResultTable table({"group",
                     "segments",
                     "rank correlation, mean over datasets",
                     "lowest",
                     "of all segments together"});
  for (std::size_t q = 0; q < groups.size(); ++q) {
    std::vector<double> entropies;
    std::vector<double> errors;
    std::vector<double> correlations;
    for (const EntropyDatasetRun& run : runs) {
      const std::size_t begin = entropies.size();
      for (const Alone& alone : run.alone) {
        entropies.push_back(alone.entropies[q]);
        errors.push_back(alone.errors[q]);
      }
      const auto from = static_cast<std::ptrdiff_t>(begin);
      correlations.push_back(
          RankCorrelation({entropies.begin() + from, entropies.end()},
                          {errors.begin() + from, errors.end()}));
    }
    histogram.series.push_back({.label = groups[q].name,
                                .style = SeriesStyle::kHistogram,
                                .x = entropies});
    scatter.series.push_back({.label = groups[q].name,
                              .style = SeriesStyle::kScatter,
                              .x = entropies,
                              .y = errors});
    table.Add({groups[q].name,
               static_cast<long>(entropies.size()),
               Mean(correlations),
               Quantile(correlations, 0),
               RankCorrelation(entropies, errors)});
    context->AtLeast(
        "entropy.rank_correlation_" + groups[q].name, Mean(correlations), 0.5);
  }
  context->WriteTable("rank_correlation", table);
  context->WritePlot("histogram", histogram);
  context->WritePlot("alone", scatter);
}

}  // namespace

void RunEntropy(Context* context) {
  Sizes sizes;
  if (context->quick()) {
    sizes = {.datasets = 2,
             .converging = 1,
             .random_draws = 2,
             .kept = 2,
             .duration_s = 21};
  }
  std::vector<EntropyDatasetRun> runs(static_cast<std::size_t>(sizes.datasets));
  context->ForEach(sizes.datasets, [&](int i) {
    const Dataset dataset = MakeDataset(i, sizes.duration_s);
    const std::vector<SegmentInformation> scores =
        ScoreAll(dataset.rig, dataset.segments());
    EstimateAll(dataset, scores, sizes, &runs[i]);
    CalibrateAlone(dataset, scores, &runs[i]);
    if (i < sizes.converging) Converge(dataset, scores, sizes.kept, &runs[i]);
    context->Progress(dataset.name);
  });
  WriteChoices(runs, context);
  PlotConvergence(runs, context);
  WriteAlone(runs, context);
}

}  // namespace selfcal
