// Real recordings: what a calibration changes, on the kept segments and on all;
// whether calibrations on disjoint sets of segments differ by what their sigmas
// say; and whether white noise leaves sigmas as they are.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/model/symmetric_eigen.h"
#include "test/evaluation/context.h"
#include "test/evaluation/datasets.h"
#include "test/evaluation/estimators.h"
#include "test/evaluation/recordings.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

struct TimedResult {
  CalibrationResult result;
  double seconds = 0;
};

TimedResult CalibrateOn(const RecordedDevice& device,
                        const std::vector<MotionSegment>& segments) {
  const auto begin = std::chrono::steady_clock::now();
  TimedResult timed{Calibrate(device.rig, device.rig.factory, segments), 0};
  timed.seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin)
          .count();
  return timed;
}

std::vector<MotionSegment> Kept(const RecordedDevice& device) {
  return Pick(
      device.segments,
      MostInformative(device.rig, ScoreAll(device.rig, device.segments)));
}

std::string Held(const CalibrationResult& result) {
  std::string text;
  for (const UnobservedDirection& direction : result.held_constant) {
    if (!text.empty()) text += "; ";
    text += direction.parts.front().component;
  }
  return text.empty() ? "nothing" : text;
}

void AddRun(const std::string& recording,
            const std::string& on,
            const TimedResult& run,
            ResultTable* table) {
  const CalibrationResult& r = run.result;
  table->Add({recording,
              on,
              r.status == CalibrateStatus::kConverged ? "yes" : "no",
              static_cast<long>(r.segments),
              static_cast<long>(r.keyframes),
              static_cast<long>(r.observations),
              static_cast<long>(r.observations_dropped),
              r.reprojection_median_before_px,
              r.reprojection_median_after_px,
              r.reprojection_rms_before_px,
              r.reprojection_rms_after_px,
              r.track_noise_factor,
              Held(r),
              static_cast<long>(r.iterations),
              run.seconds});
}

void WriteParameters(const RecordedDevice& device,
                     const CalibrationResult& kept,
                     const CalibrationResult& all,
                     Context* context) {
  ResultTable table({"parameter",
                     "unit",
                     "stored",
                     "kept segments minus stored",
                     "sigma",
                     "all segments minus stored",
                     "sigma of it",
                     "difference [sigma of kept]"});
  const Calibration& stored = device.rig.factory;
  const auto components = TangentComponents(stored);
  const Eigen::VectorXd before = ReadableValues(stored);
  // Differences: the vector of a rotation near pi may change its sign.
  const Eigen::VectorXd a = BoxMinus(kept.theta, stored);
  const Eigen::VectorXd b = BoxMinus(all.theta, stored);
  const Eigen::VectorXd difference = BoxMinus(kept.theta, all.theta);
  for (const int i : FreeComponents(device.rig)) {
    const double sigma = std::sqrt(kept.covariance(i, i));
    table.Add({components[i].name,
               components[i].unit,
               before(i),
               a(i),
               sigma,
               b(i),
               std::sqrt(all.covariance(i, i)),
               difference(i) / sigma});
  }
  context->WriteTable(device.name + "_parameters", table);
}

void DescribeRecordings(const std::vector<RecordedDevice>& devices,
                        Context* context) {
  ResultTable table({"recording",
                     "on",
                     "converged",
                     "segments",
                     "keyframes",
                     "observations",
                     "dropped",
                     "median before [px]",
                     "after [px]",
                     "rms before [px]",
                     "rms after [px]",
                     "track noise factor",
                     "held",
                     "iterations",
                     "seconds"});
  for (const RecordedDevice& device : devices) {
    const TimedResult kept = CalibrateOn(device, Kept(device));
    const TimedResult all = CalibrateOn(device, device.segments);
    AddRun(device.name, "kept", kept, &table);
    AddRun(device.name, "all", all, &table);
    WriteParameters(device, kept.result, all.result, context);
    context->Progress(device.name);
  }
  context->WriteTable("recordings", table);
}

// A way to part the segments of a recording in two.
struct Split {
  std::string name;
  bool interleaved = false;
  std::function<bool(int index, int count)> first;
};

const std::vector<Split>& Splits() {
  static const std::vector<Split> splits = {
      {"halves", false, [](int i, int n) { return i < n / 2; }},
      {"even and odd", true, [](int i, int) { return i % 2 == 0; }},
      {"pairs in turn", true, [](int i, int) { return i / 2 % 2 == 0; }},
      {"threes in turn", true, [](int i, int) { return i / 3 % 2 == 0; }},
  };
  return splits;
}

// The difference of two calibrations in joint sigmas: rms over components, and
// between which values this lies nine times in ten if errors are as both
// covariances say. Components are correlated, so that few directions decide it.
struct Difference {
  double rms = 0;
  double low = 0;
  double high = 0;
};

Difference Compare(const RecordedDevice& device,
                   const CalibrationResult& a,
                   const CalibrationResult& b) {
  constexpr int kDraws = 10'000;
  const std::vector<int> free = FreeComponents(device.rig);
  const Eigen::MatrixXd joint = (a.covariance + b.covariance)(free, free);
  const Eigen::VectorXd sigma = joint.diagonal().cwiseSqrt();
  const Eigen::VectorXd z =
      BoxMinus(a.theta, b.theta)(free).cwiseQuotient(sigma);
  const Eigen::VectorXd variances =
      SymmetricEigenvalues(sigma.cwiseInverse().asDiagonal() * joint *
                           sigma.cwiseInverse().asDiagonal());
  std::mt19937_64 engine(1);
  std::normal_distribution<double> normal;
  const auto count = static_cast<double>(free.size());
  std::vector<double> drawn;
  for (int k = 0; k < kDraws; ++k) {
    const Eigen::VectorXd x = Eigen::VectorXd::NullaryExpr(
        variances.size(), [&] { return normal(engine); });
    drawn.push_back(
        std::sqrt(x.cwiseAbs2().dot(variances.cwiseMax(0)) / count));
  }
  return {std::sqrt(z.squaredNorm() / count),
          Quantile(drawn, 0.05),
          Quantile(drawn, 0.95)};
}

CalibrationResult CalibratePart(const RecordedDevice& device,
                                const Split& split,
                                bool first,
                                const CalibrateOptions& options) {
  const int count = static_cast<int>(device.segments.size());
  std::vector<MotionSegment> part;
  for (int i = 0; i < count; ++i) {
    if (split.first(i, count) == first) part.push_back(device.segments[i]);
  }
  return Calibrate(device.rig, device.rig.factory, part, options);
}

void CompareDisjointSets(const RecordedDevice& tango, Context* context) {
  ResultTable table({"split",
                     "difference by reported sigma, rms",
                     "5 % by chance",
                     "95 % by chance",
                     "by formal sigma, rms",
                     "converged"});
  std::vector<double> interleaved;
  for (const Split& split : Splits()) {
    const auto compare = [&](bool correlated_tracks, bool* converged) {
      const CalibrateOptions options{.correlated_tracks = correlated_tracks};
      const CalibrationResult a = CalibratePart(tango, split, true, options);
      const CalibrationResult b = CalibratePart(tango, split, false, options);
      *converged = a.status == CalibrateStatus::kConverged &&
                   b.status == CalibrateStatus::kConverged;
      return Compare(tango, a, b);
    };
    bool converged = false, formal_converged = false;
    const Difference reported = compare(true, &converged);
    const Difference formal = compare(false, &formal_converged);
    table.Add({split.name,
               reported.rms,
               reported.low,
               reported.high,
               formal.rms,
               converged && formal_converged ? "yes" : "no"});
    if (split.interleaved) {
      interleaved.push_back(reported.rms);
    } else {
      context->Within("recordings.tango_halves_rms_sigmas",
                      reported.rms,
                      0.8,
                      1.3,
                      {.unit = "sigma"});
    }
    context->Progress("tango_handheld, " + split.name);
  }
  context->WriteTable("disjoint_sets", table);
  context->Within("recordings.tango_interleaved_rms_sigmas",
                  Rms(interleaved),
                  0.8,
                  1.3,
                  {.unit = "sigma"});
}

// The reported sigma by the formal one on simulated data with white noise:
// smallest and largest over components and devices.
void CompareWithFormal(Context* context) {
  const int devices = context->quick() ? 1 : 5;
  std::vector<double> low(devices), high(devices);
  context->ForEach(devices, [&](int i) {
    const Dataset dataset = MakeDataset(i, 33);
    const auto sigmas = [&](bool correlated_tracks) -> Eigen::ArrayXd {
      return Calibrate(dataset.rig,
                       dataset.rig.factory,
                       dataset.segments(),
                       {.correlated_tracks = correlated_tracks})
          .covariance.diagonal()
          .array()
          .sqrt();
    };
    const Eigen::ArrayXd reported = sigmas(true), formal = sigmas(false);
    low[i] = high[i] = 1;
    for (const int c : FreeComponents(dataset.rig)) {
      low[i] = std::min(low[i], reported(c) / formal(c));
      high[i] = std::max(high[i], reported(c) / formal(c));
    }
    context->Progress(fmt::format("white noise, {}", dataset.name));
  });
  ResultTable table({"device", "smallest ratio of sigmas", "largest"});
  for (int i = 0; i < devices; ++i) {
    table.Add({static_cast<long>(i + 1), low[i], high[i]});
  }
  context->WriteTable("white_noise", table);
  context->AtLeast("recordings.white_noise_sigma_ratio_min",
                   *std::min_element(low.begin(), low.end()),
                   0.9,
                   {.robust = true});
  context->AtMost("recordings.white_noise_sigma_ratio_max",
                  *std::max_element(high.begin(), high.end()),
                  1.1,
                  {.robust = true});
}

}  // namespace

void RunRecordings(Context* context) {
  CompareWithFormal(context);
  const std::vector<RecordedDevice> devices = ReadRecordings();
  if (devices.empty()) {
    context->Progress("no recordings beside the checkout: left out");
    return;
  }
  DescribeRecordings(devices, context);
  if (context->quick()) return;
  for (const RecordedDevice& device : devices) {
    if (device.name == "tango_handheld") CompareDisjointSets(device, context);
  }
}

}  // namespace selfcal
