// Does following the coach save recorded time? And do its motions bring what it
// predicts?
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "core/coach/advise.h"
#include "core/information/segment_information.h"
#include "test/evaluation/coach_study.h"
#include "test/evaluation/context.h"
#include "test/evaluation/estimators.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

// The target of each run is what being carried about, calm and excited by
// turns, reaches in so many segments.
constexpr int kMixedSegments[] = {15, 30};
constexpr int kQuickMixedSegments[] = {4, 6};
// From one motion to another, while nothing is recorded.
constexpr double kChange_s = 2;
// Of the calibrations that are compared with the truth.
constexpr int kCalibrated = 6;

struct WayOutcome {
  double seconds[2] = {};  // to each target
  bool reached[2] = {};
  double with_changes_s[2] = {};
  double rate_radps = 0, accel_mps2 = 0;
  bool converged = false;  // of a calibration on the first segments
  double error = 0;        // of that [sigma_ref], rms
  double claimed = 0;      // the same of its sigmas
  double nees = 0;         // over the degrees
  std::vector<std::string> motions;
};

struct CoachOutcome {
  std::string device;
  double targets[2] = {};
  std::map<Way, WayOutcome> ways;
};

void CompareWithTruth(const CoachedDevice& device,
                      const CoachRecording& recording,
                      WayOutcome* outcome) {
  const int count =
      std::min(kCalibrated, static_cast<int>(recording.segments.size()));
  const CalibrationResult result =
      Calibrate(device.rig,
                device.rig.factory,
                Pick(recording.segments, AllSegments(count)));
  outcome->converged = result.status == CalibrateStatus::kConverged;
  if (!outcome->converged) return;
  const std::vector<int> free = FreeComponents(device.rig);
  const Eigen::VectorXd reference = ReferenceSigmas(device.rig)(free);
  const Eigen::VectorXd error = BoxMinus(device.truth, result.theta);
  const Eigen::VectorXd sigmas = result.covariance.diagonal().cwiseSqrt();
  const auto rms = [&](const Eigen::VectorXd& of) {
    return std::sqrt(
        Eigen::VectorXd(of(free)).cwiseQuotient(reference).squaredNorm() /
        static_cast<double>(free.size()));
  };
  outcome->error = rms(error);
  outcome->claimed = rms(sigmas);
  const auto [square, dof] = NormalisedSquaredError(error, result.covariance);
  outcome->nees = square / dof;
}

CoachOutcome RunOne(int rig, std::uint64_t seed, bool quick) {
  const auto& mixed_segments = quick ? kQuickMixedSegments : kMixedSegments;
  const int most = mixed_segments[1];
  const CoachedDevice device = MakeCoachedDevice(rig, seed);
  CoachOutcome outcome;
  outcome.device = device.name;
  const CoachRecording mixed = Record(device, Way::kMixed, most, seed);
  for (int i = 0; i < 2; ++i) {
    outcome.targets[i] = mixed.largest[mixed_segments[i] - 1];
  }
  for (const Way way : kWays) {
    const CoachRecording recording =
        way == Way::kMixed ? mixed : Record(device, way, most, seed);
    WayOutcome& of = outcome.ways[way];
    for (int i = 0; i < 2; ++i) {
      const int needed = recording.SegmentsTo(outcome.targets[i]);
      of.reached[i] = needed > 0;
      const int counted = needed > 0 ? needed : most;
      of.seconds[i] = counted * recording.segment_s;
      of.with_changes_s[i] =
          of.seconds[i] + kChange_s * recording.Changes(counted);
    }
    of.rate_radps = recording.rms_rate_radps;
    of.accel_mps2 = recording.rms_accel_mps2;
    of.motions = recording.motions;
    CompareWithTruth(device, recording, &of);
  }
  return outcome;
}

// Of one device and way, over the seeds.
struct WaySeries {
  std::vector<double> seconds[2], with_changes[2], factors[2];
  std::vector<double> rates, accels, errors, claimed, nees;
  long reached[2] = {};
  int converged = 0;
};

WaySeries Collect(const std::vector<CoachOutcome>& all,
                  const std::string& device,
                  Way way) {
  WaySeries series;
  for (const CoachOutcome& one : all) {
    if (one.device != device) continue;
    const WayOutcome& of = one.ways.at(way);
    const WayOutcome& coached = one.ways.at(Way::kCoached);
    for (int i = 0; i < 2; ++i) {
      series.seconds[i].push_back(of.seconds[i]);
      series.with_changes[i].push_back(of.with_changes_s[i]);
      series.factors[i].push_back(of.seconds[i] / coached.seconds[i]);
      series.reached[i] += of.reached[i];
    }
    series.rates.push_back(of.rate_radps);
    series.accels.push_back(of.accel_mps2);
    series.converged += of.converged;
    if (!of.converged) continue;
    series.errors.push_back(of.error);
    series.claimed.push_back(of.claimed);
    series.nees.push_back(of.nees);
  }
  return series;
}

void TabulateTimes(const std::vector<CoachOutcome>& all,
                   const std::vector<std::string>& devices,
                   Context* context) {
  ResultTable times({"device",
                     "way",
                     "runs",
                     "target",
                     "reached",
                     "recorded [s], median",
                     "with changes of motion [s]",
                     "against coached, median",
                     "least",
                     "most"});
  ResultTable truth({"device",
                     "way",
                     "rms rate [rad/s]",
                     "rms acceleration [m/s^2]",
                     "converged",
                     "error after 6 segments [sigma_ref]",
                     "claimed [sigma_ref]",
                     "NEES / D"});
  for (const std::string& device : devices) {
    for (const Way way : kWays) {
      const WaySeries series = Collect(all, device, way);
      const long runs = static_cast<long>(series.rates.size());
      for (int i = 0; i < 2; ++i) {
        const auto& factors = series.factors[i];
        times.Add({device,
                   NameOf(way),
                   runs,
                   std::string(i == 0 ? "near" : "far"),
                   series.reached[i],
                   MedianOf(series.seconds[i]),
                   MedianOf(series.with_changes[i]),
                   MedianOf(factors),
                   *std::min_element(factors.begin(), factors.end()),
                   *std::max_element(factors.begin(), factors.end())});
      }
      truth.Add({device,
                 NameOf(way),
                 Mean(series.rates),
                 Mean(series.accels),
                 static_cast<long>(series.converged),
                 Rms(series.errors),
                 Rms(series.claimed),
                 Mean(series.nees)});
    }
  }
  context->WriteTable("times", times);
  context->WriteTable("truth", truth);
}

void TabulateMotions(const std::vector<CoachOutcome>& all,
                     const std::vector<std::string>& devices,
                     const Context& context) {
  ResultTable table({"device", "motion", "share of the coached segments"});
  for (const std::string& device : devices) {
    std::map<std::string, long> counts;
    long sum = 0;
    for (const CoachOutcome& one : all) {
      if (one.device != device) continue;
      for (const auto& motion : one.ways.at(Way::kCoached).motions) {
        ++counts[motion];
        ++sum;
      }
    }
    for (const auto& [motion, count] : counts) {
      table.Add({device,
                 motion,
                 static_cast<double>(count) / static_cast<double>(sum)});
    }
  }
  context.WriteTable("motions", table);
}

// Gains of the same motion, predicted and of a segment that comes [nat].
struct Prediction {
  double predicted = 0, actual = 0;
  double sigma_ratio = 0;  // predicted sigma against actual, geometric mean
};

double TotalGain(const Rig& rig,
                 const Eigen::MatrixXd& known,
                 const Eigen::MatrixXd& Lambda) {
  Predictions one;
  one.theta = rig.factory;
  one.motions = {{"", "", Lambda}};
  return Advise(rig, one, known).advice.front().gain_nats;
}

std::vector<Prediction> PredictAll(int rig, std::uint64_t seed) {
  const CoachedDevice device = MakeCoachedDevice(rig, seed);
  const Rig& of = device.rig;
  const Predictions predictions = Predict(of, of.factory);
  const Eigen::MatrixXd prior =
      PriorSigmas(of).cwiseAbs2().cwiseInverse().asDiagonal();
  std::vector<Prediction> result;
  for (std::size_t i = 0; i < Primitives().size(); ++i) {
    SimulationOptions options;
    options.seed = 50'000 + 100 * seed + i;
    options.revisit_fraction = 0;
    const MotionSegment segment = SimulatePrimitive(
        of, device.truth, of.factory, Primitives()[i], options);
    Prediction& one = result.emplace_back();
    one.predicted = TotalGain(of, prior, predictions.motions[i].Lambda);
    one.actual =
        TotalGain(of, prior, ScoreSegment(of, of.factory, segment).Lambda);
    one.sigma_ratio = std::exp((one.actual - one.predicted) /
                               static_cast<double>(FreeComponents(of).size()));
  }
  return result;
}

void ComparePredictions(int seeds, Context* context) {
  const int count = kCoachedRigs * seeds;
  std::vector<std::vector<Prediction>> all(count);
  context->ForEach(count, [&](int i) {
    all[i] = PredictAll(i / seeds, static_cast<std::uint64_t>(i % seeds) + 1);
  });
  ResultTable table({"motion",
                     "segments",
                     "predicted gain [nat]",
                     "actual gain [nat]",
                     "sigma predicted / actual",
                     "least",
                     "most"});
  std::vector<double> every;
  for (std::size_t m = 0; m < Primitives().size(); ++m) {
    std::vector<double> predicted, actual, ratios;
    for (const auto& run : all) {
      predicted.push_back(run[m].predicted);
      actual.push_back(run[m].actual);
      ratios.push_back(run[m].sigma_ratio);
    }
    every.insert(every.end(), ratios.begin(), ratios.end());
    table.Add({std::string(Primitives()[m].name),
               static_cast<long>(ratios.size()),
               Mean(predicted),
               Mean(actual),
               MedianOf(ratios),
               *std::min_element(ratios.begin(), ratios.end()),
               *std::max_element(ratios.begin(), ratios.end())});
  }
  context->WriteTable("predictions", table);
  context->Within(
      "coach.sigma_predicted_by_actual", MedianOf(every), 0.8, 1.25);
}

}  // namespace

void RunCoach(Context* context) {
  const int seeds = context->quick() ? 1 : 10;
  const int rigs = context->quick() ? 1 : kCoachedRigs;
  std::vector<CoachOutcome> all(rigs * seeds);
  context->ForEach(rigs * seeds, [&](int i) {
    all[i] = RunOne(
        i / seeds, static_cast<std::uint64_t>(i % seeds) + 1, context->quick());
    context->Progress(all[i].device + ", " + std::to_string(i % seeds + 1));
  });
  std::vector<std::string> devices;
  for (int rig = 0; rig < rigs; ++rig) {
    devices.push_back(MakeCoachedDevice(rig, 1).name);
  }
  TabulateTimes(all, devices, context);
  TabulateMotions(all, devices, *context);
  for (int rig = 0; rig < rigs; ++rig) {
    for (const Way way : {Way::kMixed, Way::kVigorous, Way::kRandom}) {
      const WaySeries series = Collect(all, devices[rig], way);
      std::string name = NameOf(way);
      std::replace(name.begin(), name.end(), ' ', '_');
      context->AtLeast(fmt::format("coach.rig_{}.{}_by_coached", rig, name),
                       MedianOf(series.factors[1]),
                       way == Way::kMixed ? 1.5 : 1);
    }
  }
  ComparePredictions(context->quick() ? 1 : 10, context);
}

}  // namespace selfcal
