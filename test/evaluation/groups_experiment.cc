// Do groups help? A table for each of the rig's groups, against one table over
// all of theta that holds as many segments as those do together.
#include <string>
#include <utility>
#include <vector>

#include "test/evaluation/context.h"
#include "test/evaluation/datasets.h"
#include "test/evaluation/estimators.h"
#include "test/evaluation/parameter_statistics.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

enum GroupKind { kSeveralGroups, kSingleGroup, kWholeBatch, kGroupKinds };
constexpr const char* kGroupsNames[] = {
    "several groups", "single group", "batch"};

struct GroupsDatasetRun {
  std::string name;
  long segments = 0;
  long kept = 0;
  long common = 0;  // of the kept ones, in both choices
  Estimate estimates[kGroupKinds];
};

GroupsDatasetRun RunDataset(int index, double duration_s, int table_size) {
  Dataset dataset = MakeDataset(index, duration_s);
  dataset.rig.table_size = table_size;
  const std::vector<SegmentInformation> scores =
      ScoreAll(dataset.rig, dataset.segments());
  const SegmentSet groups = MostInformative(dataset.rig, scores);
  const SegmentSet single =
      SingleGroup(dataset.rig, static_cast<int>(groups.size()), scores);
  GroupsDatasetRun run;
  run.name = dataset.name;
  run.segments = static_cast<long>(scores.size());
  run.kept = static_cast<long>(groups.size());
  for (const int i : groups) {
    for (const int j : single) run.common += i == j;
  }
  const auto estimate = [&](const SegmentSet& set) -> Estimate {
    const CalibrationResult result =
        CalibrateOn(dataset.rig, dataset.segments(), set);
    return {result.theta, result.covariance.diagonal().cwiseSqrt()};
  };
  run.estimates[kSeveralGroups] = estimate(groups);
  run.estimates[kSingleGroup] = estimate(single);
  run.estimates[kWholeBatch] =
      estimate(AllSegments(static_cast<int>(scores.size())));
  return run;
}

}  // namespace

void RunGroups(Context* context) {
  const int count = context->quick() ? 3 : kDatasets;
  const double duration_s = context->quick() ? 45 : kDatasetDuration_s;
  const int table_size = context->quick() ? 2 : 8;
  std::vector<GroupsDatasetRun> runs(static_cast<std::size_t>(count));
  context->ForEach(count, [&](int i) {
    runs[i] = RunDataset(i, duration_s, table_size);
    context->Progress(runs[i].name);
  });
  ResultTable kept({"dataset", "segments", "kept", "in both choices"});
  for (const GroupsDatasetRun& run : runs) {
    kept.Add({run.name, run.segments, run.kept, run.common});
  }
  context->WriteTable("kept", kept);
  std::vector<std::pair<std::string, ParameterStatistics>> all;
  for (const GroupKind kind : {kSeveralGroups, kSingleGroup, kWholeBatch}) {
    std::vector<Estimate> estimates;
    for (const GroupsDatasetRun& run : runs)
      estimates.push_back(run.estimates[kind]);
    all.emplace_back(kGroupsNames[kind],
                     Summarise(MakeDevice().truth, estimates));
  }
  context->WriteTable("parameters", CompareParameters(MakeDevice().truth, all));
  const ParameterStatistics& groups = all[kSeveralGroups].second;
  const ParameterStatistics& single = all[kSingleGroup].second;
  context->AtMost("groups.spread_against_single_group",
                  MedianOf(Ratios(groups.spread, single.spread)),
                  1);
  context->AtMost("groups.error_against_single_group",
                  MedianOf(Ratios(groups.rms_error, single.rms_error)),
                  1);
  context->AtMost("groups.sigma_against_single_group",
                  MedianOf(Ratios(groups.rms_sigma, single.rms_sigma)),
                  1);
}

}  // namespace selfcal
