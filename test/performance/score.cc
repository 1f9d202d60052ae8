#include "test/performance/score.h"

#include <benchmark/benchmark.h>

#include <memory>

#include "core/information/segment_scorer.h"

namespace selfcal {

TimedFunction ScoreOf(const Scene& scene, VectorWidth width) {
  const auto scorer = std::make_shared<SegmentScorer>(width);
  const auto result = std::make_shared<SegmentInformation>();
  return {"score", [&scene, scorer, result] {
            scorer->Score(scene.rig,
                          scene.rig.factory,
                          scene.segments.front(),
                          {},
                          result.get());
            benchmark::DoNotOptimize(result->rank);
          }};
}

}  // namespace selfcal
