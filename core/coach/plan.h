// A plan of the motions that are still to be recorded until the data determines
// every direction of theta and is enough to confirm a calibration, with their
// predicted information: segment by segment the motion that teaches most of
// what is missing and, once nothing is, the one with the largest gain.
//
// A direction is missing while its standard deviation, in units of the prior's,
// is above a limit. The sum of the information of all planned segments is what
// the standard deviations after the plan are computed from.
//
// Pure, deterministic, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <vector>

#include "core/coach/predict.h"
#include "core/information/segment_information.h"
#include "core/model/rig.h"

namespace selfcal {

// A plan ends there, whatever is missing then.
inline constexpr int kMostPlannedSegments = 15;

struct Lesson {
  std::string_view motion;  // Primitive::name
  std::string_view instruction;
  int segments = 0;  // of Predictions::segment_s
};

// A unit vector in units of the prior's sigmas; standard deviations are in the
// same units: 1 is what was known before any data.
struct MissingDirection {
  std::string words;
  std::vector<UnobservedDirection::Part> parts;  // largest first
  double sigma = 0;
  double sigma_after = 0;  // all lessons
  // That of the lesson without which sigma_after would be largest; empty if
  // there is no lesson.
  std::string_view motion;
};

struct Plan {
  std::vector<Lesson> lessons;            // the longest first
  std::vector<MissingDirection> missing;  // the least known first
};

struct PlanGoal {
  double learned_below = 0.5;  // the limit, in (0, 1]
  int segments = 0;            // to be recorded, whatever is missing
};

// `known` as in Advise. Without a lesson for what is missing, no motion teaches
// it.
Plan MakePlan(const Rig& rig,
              const Predictions& predictions,
              const Eigen::MatrixXd& known,
              const PlanGoal& goal);

}  // namespace selfcal
