// Which choice of segments does best on a real recording, at equal number: the
// entropy tables of the paper, the joint choice, or random ones.
//
// Truth is not known: each calibration is compared with that on all segments,
// in units of what all segments say (so that an efficient subset of a part p of
// the information is off by (1 - p) / p a dimension, squared, on average).
#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/information/segment_information.h"
#include "core/selection/candidate.h"
#include "core/selection/joint_selection.h"
#include "core/selection/tables.h"
#include "test/evaluation/context.h"
#include "test/evaluation/estimators.h"
#include "test/evaluation/recordings.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

constexpr int kDraws = 60;
constexpr int kQuickDraws = 4;
constexpr std::uint64_t kSeed = 1;

struct ScoredRecording {
  RecordedDevice device;
  std::vector<SegmentInformation> scores;
  CalibrationResult batch;
};

// Best first: the union of the tables, one entry of each after the other.
std::vector<int> OrderByEntropy(const ScoredRecording& recording) {
  const int count = static_cast<int>(recording.scores.size());
  const std::size_t groups = recording.scores.front().groups.size();
  std::vector<std::vector<int>> ranked(groups);
  for (std::size_t q = 0; q < groups; ++q) {
    ranked[q].resize(count);
    std::iota(ranked[q].begin(), ranked[q].end(), 0);
    std::stable_sort(ranked[q].begin(), ranked[q].end(), [&](int a, int b) {
      return recording.scores[a].groups[q].entropy <
             recording.scores[b].groups[q].entropy;
    });
  }
  std::vector<int> order;
  for (int rank = 0; rank < count; ++rank) {
    for (std::size_t q = 0; q < groups; ++q) {
      const int segment = ranked[q][rank];
      if (std::find(order.begin(), order.end(), segment) == order.end()) {
        order.push_back(segment);
      }
    }
  }
  return order;
}

std::vector<int> ChooseJointly(const ScoredRecording& recording,
                               int size,
                               bool share_landmarks) {
  const Rig& rig = recording.device.rig;
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < recording.scores.size(); ++i) {
    candidates.push_back(MakeCandidate(rig,
                                       recording.device.segments[i].key,
                                       static_cast<std::int64_t>(i),
                                       recording.scores[i]));
  }
  JointSettings settings = MakeJointSettings(rig, Criterion::kD);
  settings.capacity = size;
  settings.share_landmarks = share_landmarks;
  return SelectGreedily(settings, candidates);
}

// How far the calibration on these segments is from that on all: rms over the
// directions of theta, in sigmas of the latter. NaN if it does not converge.
double DistanceIfConverged(const ScoredRecording& recording,
                           const std::vector<int>& chosen) {
  const RecordedDevice& device = recording.device;
  const CalibrationResult result = Calibrate(device.rig,
                                             device.rig.factory,
                                             Pick(device.segments, chosen),
                                             ComparedOptions());
  if (result.status != CalibrateStatus::kConverged) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  const std::vector<int> free = FreeComponents(device.rig);
  const Eigen::VectorXd off =
      BoxMinus(result.theta, recording.batch.theta)(free);
  const Eigen::MatrixXd covariance = recording.batch.covariance(free, free);
  return std::sqrt(off.dot(covariance.ldlt().solve(off)) /
                   static_cast<double>(off.size()));
}

// The same for a choice that has to converge.
double Distance(const ScoredRecording& recording,
                const std::vector<int>& chosen) {
  const double distance = DistanceIfConverged(recording, chosen);
  if (std::isnan(distance)) {
    throw std::runtime_error("the calibration on chosen segments failed");
  }
  return distance;
}

std::vector<int> RandomChoice(int count, int size, std::mt19937_64* random) {
  std::vector<int> all(count);
  std::iota(all.begin(), all.end(), 0);
  // Not std::shuffle, whose result is the library's own.
  for (int i = 0; i < size; ++i) {
    const auto left = static_cast<std::uint64_t>(count - i);
    std::swap(all[i], all[i + static_cast<int>((*random)() % left)]);
  }
  all.resize(size);
  std::sort(all.begin(), all.end());
  return all;
}

void CompareAtSize(const ScoredRecording& recording,
                   int size,
                   ResultTable* table,
                   Plot* plot,
                   Context* context) {
  const int count = static_cast<int>(recording.scores.size());
  const int random_draws = context->quick() ? kQuickDraws : kDraws;
  std::vector<int> order = OrderByEntropy(recording);
  const std::vector<int> most(order.begin(), order.begin() + size);
  const std::vector<int> least(order.end() - size, order.end());
  const double by_entropy = Distance(recording, most);
  const double by_joint =
      Distance(recording, ChooseJointly(recording, size, true));
  const double by_joint_alone =
      Distance(recording, ChooseJointly(recording, size, false));
  const double by_least = DistanceIfConverged(recording, least);
  std::mt19937_64 random(kSeed + size);
  std::vector<std::vector<int>> choices;
  for (int i = 0; i < random_draws; ++i) {
    choices.push_back(RandomChoice(count, size, &random));
  }
  std::vector<double> draws(random_draws);
  context->ForEach(random_draws, [&](int i) {
    draws[i] = DistanceIfConverged(recording, choices[i]);
  });
  // The daemon would reject them; they are as bad as any.
  const auto converged = std::count_if(
      draws.begin(), draws.end(), [](double d) { return !std::isnan(d); });
  std::replace_if(
      draws.begin(),
      draws.end(),
      [](double d) { return std::isnan(d); },
      std::numeric_limits<double>::infinity());
  const auto better = [&](double distance) {
    return static_cast<double>(
               std::count_if(draws.begin(),
                             draws.end(),
                             [&](double draw) { return draw < distance; })) /
           random_draws;
  };
  table->Add({static_cast<long>(size),
              by_entropy,
              by_joint,
              by_joint_alone,
              by_least,
              Quantile(draws, 0.25),
              MedianOf(draws),
              Quantile(draws, 0.75),
              static_cast<long>(random_draws - converged),
              better(by_entropy),
              better(by_joint)});
  const auto add = [&](std::size_t series, double y) {
    plot->series[series].x.push_back(size);
    plot->series[series].y.push_back(y);
  };
  add(0, by_entropy);
  add(1, by_joint);
  add(2, by_least);
  add(3, MedianOf(draws));
  plot->series[3].low.push_back(Quantile(draws, 0.25));
  plot->series[3].high.push_back(Quantile(draws, 0.75));
  context->AtMost(
      fmt::format("recorded_choice.entropy_against_random_{}", size),
      by_entropy / MedianOf(draws),
      1);
  context->AtMost(fmt::format("recorded_choice.joint_against_random_{}", size),
                  by_joint / MedianOf(draws),
                  1);
  context->Progress(fmt::format("{} segments", size));
}

}  // namespace

void RunRecordedChoice(Context* context) {
  ResultTable table({"segments",
                     "entropy",
                     "joint",
                     "joint, landmarks not shared",
                     "least informative",
                     "random, quartile",
                     "median",
                     "quartile above",
                     "random not converged",
                     "random better than entropy",
                     "random better than joint"});
  const std::optional<RecordedDevice> tango = ReadTango();
  if (!tango) {
    context->Progress("no recordings beside the checkout: left out");
    context->WriteTable("choices", table);
    return;
  }
  ScoredRecording recording{*tango, {}, {}};
  for (const MotionSegment& segment : tango->segments) {
    recording.scores.push_back(
        ScoreSegment(tango->rig, tango->rig.factory, segment));
  }
  recording.batch = Calibrate(
      tango->rig, tango->rig.factory, tango->segments, ComparedOptions());
  Plot plot{.title = "A calibration on some segments against that on all",
            .x_label = "segments",
            .y_label = "rms distance [sigma of all]",
            .log_y = true,
            .series = {{.label = "entropy"},
                       {.label = "joint"},
                       {.label = "least informative"},
                       {.label = "random, median and quartiles"}}};
  const std::vector<int> sizes =
      context->quick() ? std::vector<int>{4} : std::vector<int>{3, 4, 5, 6, 8};
  for (const int size : sizes) {
    CompareAtSize(recording, size, &table, &plot, context);
  }
  context->WriteTable("choices", table);
  context->WritePlot("choices", plot);
}

}  // namespace selfcal
