// The score as the benchmark calls it: again and again, for one vector width.
#pragma once

#include "core/simd/vector_width.h"
#include "test/performance/scene.h"
#include "test/performance/timing.h"

namespace selfcal {

// Scores the first segment of the scene at the factory's calibration. The scene
// must outlive it.
TimedFunction ScoreOf(const Scene& scene, VectorWidth width);

}  // namespace selfcal
