// Growth of the time of the score with threads, keyframes, observations and a
// rolling shutter, and the gain of wider vectors.
#include <fmt/format.h>

#include <string>
#include <thread>
#include <vector>

#include "core/simd/vector_width.h"
#include "test/performance/cases.h"
#include "test/performance/scene.h"
#include "test/performance/score.h"

namespace selfcal {
namespace {

// Scores in one call, so many that starting a thread does not count.
constexpr int kScores = 64;

// kScores scores, shared evenly by the threads.
void ScoreOnThreads(const Scene& scene, int threads) {
  std::vector<std::jthread> running;
  for (int i = 0; i < threads; ++i) {
    running.emplace_back([&scene, threads] {
      const TimedFunction score = ScoreOf(scene, WidestVectors());
      for (int n = 0; n < kScores / threads; ++n) score.run();
    });
  }
}

Measurement TwoThreadsAgainstOne(const TimingOptions& options) {
  const Scene scene = MakeScene();
  return CompareTimes({"one thread", [&] { ScoreOnThreads(scene, 1); }},
                      {"two threads", [&] { ScoreOnThreads(scene, 2); }},
                      options,
                      Clock::kWall);
}

Measurement CompareScenes(const SceneOptions& larger,
                          const SceneOptions& reference,
                          const TimingOptions& options) {
  const Scene a = MakeScene(larger);
  const Scene b = MakeScene(reference);
  TimedFunction score_a = ScoreOf(a, WidestVectors());
  TimedFunction score_b = ScoreOf(b, WidestVectors());
  score_a.name = "larger";
  score_b.name = "reference";
  Measurement result = CompareTimes(score_a, score_b, options);
  result.figures["observations"] =
      static_cast<double>(a.segments.front().observations.size()) /
      static_cast<double>(b.segments.front().observations.size());
  return result;
}

Case WidthCase(VectorWidth width) {
  return {
      .name = fmt::format("score: {} against portable", VectorWidthName(width)),
      .measure = [width](const TimingOptions& options) {
        const Scene scene = MakeScene();
        TimedFunction portable = ScoreOf(scene, VectorWidth::k2);
        portable.name = "portable";
        return CompareTimes(portable, ScoreOf(scene, width), options);
      }};
}

}  // namespace

std::vector<Case> ScalingCases() {
  std::vector<Case> cases = {
      {.name = "two threads against one",
       .must = 1.9,
       .goal = 1.95,
       .measure = TwoThreadsAgainstOne},
      {.name = "score: 160 keyframes against 80",
       .higher_is_better = false,
       .measure =
           [](const TimingOptions& options) {
             // At a fixed track length.
             constexpr int kTrack = 20;
             return CompareScenes({.keyframes = 160,
                                   .max_track_length = kTrack,
                                   .revisit_fraction = 0},
                                  {.keyframes = 80,
                                   .max_track_length = kTrack,
                                   .revisit_fraction = 0},
                                  options);
           }},
      {.name = "score: twice the observations",
       .higher_is_better = false,
       .measure =
           [](const TimingOptions& options) {
             return CompareScenes({.landmarks_in_view = 260}, {}, options);
           }},
      {.name = "score: rolling shutter against global",
       .must = 1.5,
       .higher_is_better = false,
       .measure =
           [](const TimingOptions& options) {
             return CompareScenes({.readout_s = 20e-3}, {}, options);
           }},
  };
  for (const VectorWidth width : {VectorWidth::k4, VectorWidth::k8}) {
    if (HasVectors(width)) cases.push_back(WidthCase(width));
  }
  return cases;
}

}  // namespace selfcal
