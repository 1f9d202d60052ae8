#include "test/performance/score.h"

#include <benchmark/benchmark.h>

#include "core/information/segment_information.h"

namespace selfcal {

TimedFunction ScoreOf(const Scene& scene, VectorWidth /*width*/) {
  return {"score", [&scene] {
            benchmark::DoNotOptimize(ScoreSegment(
                scene.rig, scene.rig.factory, scene.segments.front()));
          }};
}

}  // namespace selfcal
