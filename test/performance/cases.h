// The cases of the benchmark: what is compared with what, and the ratio that it
// must reach.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "test/performance/timing.h"

namespace selfcal {

struct Measurement {
  double ratio = 0;
  // By name: median times [ms], counts.
  std::map<std::string, double> figures = {};
};

struct Case {
  std::string name;
  // None: for information.
  std::optional<double> must = {};
  std::optional<double> goal = {};
  bool higher_is_better = true;
  std::function<Measurement(const TimingOptions&)> measure;
};

// The time of a by the time of b, by the median over pairs of runs.
Measurement CompareTimes(const TimedFunction& a,
                         const TimedFunction& b,
                         const TimingOptions& options,
                         Clock clock = Clock::kCpu);

std::vector<Case> ScoreCases();
std::vector<Case> CalibrationCases();
std::vector<Case> ScalingCases();

}  // namespace selfcal
