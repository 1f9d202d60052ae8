// Run-time of each estimator on the same dataset, in one run: table II of the
// paper. All on one thread, with the same factors; CPU time of the process,
// which leaves out what others do on the machine. The cheap ones take turns,
// several times; what takes minutes runs once, between them.
#include <fmt/format.h>

#include <ctime>
#include <functional>
#include <string>
#include <vector>

#include "core/information/fusion.h"
#include "test/evaluation/context.h"
#include "test/evaluation/datasets.h"
#include "test/evaluation/estimators.h"
#include "test/evaluation/information_gain.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

constexpr int kDataset = 0;

double CpuSeconds(const std::function<void()>& work) {
  const std::clock_t begin = std::clock();
  work();
  return static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
}

struct Timed {
  std::vector<double> score, informative, batch;  // [s], by repetition
  double batch_ceres = 0;
  // If not, the time until it gave up.
  bool ceres_converged = false;
  double gain = 0;             // until as many are kept as by the tables
  double gain_everywhere = 0;  // until every segment was evaluated
  long segments = 0;
  long kept = 0;
  long kept_gain = 0;
};

void TimeInTurn(const Dataset& dataset, Timed* timed) {
  const Rig& rig = dataset.rig;
  const std::vector<MotionSegment>& segments = dataset.segments();
  std::vector<SegmentInformation> scores;
  SegmentSet kept;
  timed->score.push_back(CpuSeconds([&] {
    scores = ScoreAll(rig, segments);
    kept = MostInformative(rig, scores);
  }));
  timed->informative.push_back(CpuSeconds([&] {
    std::vector<SegmentInformation> known;
    for (const int i : kept) known.push_back(scores[i]);
    Calibrate(
        rig, Fuse(rig, known).theta, Pick(segments, kept), ComparedOptions());
  }));
  timed->batch.push_back(CpuSeconds([&] {
    CalibrateOn(rig, segments, AllSegments(static_cast<int>(segments.size())));
  }));
  timed->segments = static_cast<long>(segments.size());
  timed->kept = static_cast<long>(kept.size());
}

Timed TimeDataset(const Dataset& dataset, int repetitions, Context* context) {
  const std::vector<MotionSegment>& segments = dataset.segments();
  Timed timed;
  const auto report = [&](const std::string& what) {
    context->Progress(fmt::format("{}: {}", dataset.name, what));
  };
  for (int i = 0; i < repetitions; ++i) TimeInTurn(dataset, &timed);
  report("informative and batch");
  CalibrateOptions with_ceres = ComparedOptions();
  with_ceres.solver = SolverKind::kCeres;
  timed.batch_ceres = CpuSeconds([&] {
    timed.ceres_converged =
        Calibrate(dataset.rig, dataset.rig.factory, segments, with_ceres)
            .status == CalibrateStatus::kConverged;
  });
  report("batch with Ceres");
  TimeInTurn(dataset, &timed);
  timed.gain = CpuSeconds([&] {
    RunInformationGain(
        dataset.rig, segments, {.stop_at = static_cast<int>(timed.kept)});
  });
  timed.gain_everywhere = CpuSeconds([&] {
    timed.kept_gain = static_cast<long>(
        RunInformationGain(dataset.rig, segments, {}).kept.size());
  });
  report("information gain");
  TimeInTurn(dataset, &timed);
  return timed;
}

double OwnSeconds(const Timed& timed) {
  return MedianOf(timed.score) + MedianOf(timed.informative);
}

// A dataset in which one new track in ten is a landmark that was seen before:
// batch ties keyframes to each other that lie minutes apart.
double BatchRatioWithRevisits(double duration_s,
                              const SimulationOptions& options,
                              ResultTable* table) {
  const Dataset dataset =
      MakeDataset(kDataset, duration_s, MakeDevice(), options);
  Timed timed;
  TimeInTurn(dataset, &timed);
  table->Add({fmt::format("{}, {:g} of new tracks found again",
                          dataset.name,
                          options.revisit_fraction),
              timed.segments,
              timed.kept,
              {},
              timed.score[0],
              timed.informative[0],
              timed.batch[0],
              {},
              {},
              {},
              {}});
  return timed.batch[0] / OwnSeconds(timed);
}

}  // namespace

void RunRunTime(Context* context) {
  const double duration_s = context->quick() ? 17 : kDatasetDuration_s;
  // Batch takes minutes and gigabytes there, of three minutes of motion.
  const double with_revisits_s = context->quick() ? 17 : 90;
  ResultTable table({"dataset",
                     "segments",
                     "kept",
                     "kept by information gain",
                     "score [s]",
                     "calibrate on the kept [s]",
                     "batch [s]",
                     "batch with Ceres [s]",
                     "Ceres converged",
                     "information gain, as many kept [s]",
                     "information gain, every segment [s]"});
  const Dataset dataset = MakeDataset(kDataset, duration_s);
  const Timed timed = TimeDataset(dataset, context->quick() ? 1 : 5, context);
  const double own = OwnSeconds(timed);
  table.Add({dataset.name,
             timed.segments,
             timed.kept,
             timed.kept_gain,
             MedianOf(timed.score),
             MedianOf(timed.informative),
             MedianOf(timed.batch),
             timed.batch_ceres,
             timed.ceres_converged ? "yes" : "no",
             timed.gain,
             timed.gain_everywhere});
  SimulationOptions revisits = DatasetOptions(kDataset);
  revisits.revisit_fraction = SimulationOptions().revisit_fraction;
  const double with_revisits =
      BatchRatioWithRevisits(with_revisits_s, revisits, &table);
  context->WriteTable("run_time", table);
  const auto check =
      [&](const std::string& name, double ratio, double must, double goal) {
        context->AtLeast("run_time." + name, ratio, must, {.unit = "times"});
        context->AtLeast(
            "run_time." + name + ".goal", ratio, goal, {.unit = "times"});
      };
  check("batch", MedianOf(timed.batch) / own, 6, 10);
  check("batch_with_revisits", with_revisits, 6, 10);
  check("batch_ceres", timed.batch_ceres / own, 60, 100);
  check(
      "information_gain_every_segment", timed.gain_everywhere / own, 250, 1000);
}

}  // namespace selfcal
