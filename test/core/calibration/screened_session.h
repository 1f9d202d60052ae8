// A simulated session at its truth, flattened, with screened landmarks: the
// input of tests of everything after the screening.
#pragma once

#include <vector>

#include "core/calibration/partition.h"
#include "core/calibration/screening.h"
#include "core/simulation/simulate.h"

namespace selfcal {

// Neither copied nor moved: the problem refers to the segments.
struct ScreenedSession {
  ScreenedSession(const Rig& true_rig,
                  const Trajectory& trajectory,
                  const SimulationOptions& options)
      : rig(true_rig),
        session(Simulate(
            rig, rig.factory, rig.factory, trajectory, "session", options)) {
    for (std::size_t s = 0; s < session.segments.size(); ++s) {
      session.segments[s].keyframes = session.truth[s].keyframes;
    }
    sorted = SortByKey(session.segments);
    problem = FlattenSegments(rig, sorted, PartitionSegments(sorted, 15));
    MeasureMotions(rig, rig.factory, problem, problem.keyframes, &motions);
    screening = ScreenLandmarks(
        rig, rig.factory, problem, problem.keyframes, motions, {}, nullptr);
  }
  ScreenedSession(const ScreenedSession&) = delete;
  ScreenedSession& operator=(const ScreenedSession&) = delete;

  const Rig rig;
  SimulatedSession session;
  std::vector<const MotionSegment*> sorted;
  CalibrationProblem problem;
  KeyframeMotions motions;
  Screening screening;
};

}  // namespace selfcal
