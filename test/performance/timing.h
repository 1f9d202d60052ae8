// Times of functions that run in turns, so that a slow moment of the machine
// falls on all of them alike. Each run is one of Google Benchmark.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace selfcal {

enum class Clock {
  kCpu,  // of the process, all threads: leaves out what others do
  kWall,
};

struct TimingOptions {
  int repetitions = 15;
  double min_time_s = 0.1;  // of each repetition of each function
};

struct TimedFunction {
  std::string name;
  std::function<void()> run;
};

// Of one call, one for each repetition [ms].
using Times = std::vector<double>;

// Calls each function once or more to warm up and to find how many calls fill
// min_time_s, then lets them take turns: first, second, ..., first, second, ...
std::vector<Times> TimeInTurns(const std::vector<TimedFunction>& functions,
                               const TimingOptions& options,
                               Clock clock);

double Median(std::vector<double> values);

// The median of a[i] / b[i].
double MedianRatio(const Times& a, const Times& b);

}  // namespace selfcal
