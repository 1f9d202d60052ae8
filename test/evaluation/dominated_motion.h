// A body that nearly always moves in one way, and rarely in another: what a
// choice of segments has to find.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "core/simulation/trajectory.h"

namespace selfcal {

// What most of the segments are.
enum class DominantMotion {
  kOneAxis,       // turns about the vertical and moves in the plane; the rest
                  // turns about the other axes and moves up and down
  kCalm,          // nearly at rest; the rest moves along or about one axis
  kRotationOnly,  // turns in place; the rest moves without turning much
};

std::string NameOf(DominantMotion dominant);

// In stretches of 4 s, each of the dominant kind but for the given part.
// Deterministic; duration_s > 4.
std::unique_ptr<Trajectory> MakeDominated(DominantMotion dominant,
                                          double rare_part,
                                          double duration_s,
                                          std::uint64_t seed);

}  // namespace selfcal
