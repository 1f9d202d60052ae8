#include "test/performance/timing.h"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace selfcal {
namespace {

// Keeps the last run, prints nothing.
class LastRun final : public benchmark::BenchmarkReporter {
 public:
  bool ReportContext(const Context&) override { return true; }
  void ReportRuns(const std::vector<Run>& runs) override {
    iterations_ = runs.back().iterations;
    const double seconds = clock_ == Clock::kCpu
                               ? runs.back().cpu_accumulated_time
                               : runs.back().real_accumulated_time;
    ms_ = 1e3 * seconds / static_cast<double>(iterations_);
  }

  explicit LastRun(Clock clock) : clock_(clock) {}
  std::int64_t iterations() const { return iterations_; }
  double ms() const { return ms_; }

 private:
  const Clock clock_;
  std::int64_t iterations_ = 0;
  double ms_ = 0;
};

// One run: of as many iterations, or, if 0, of as many as fill the time.
LastRun Run(const TimedFunction& function,
            std::int64_t iterations,
            double min_time_s,
            Clock clock) {
  benchmark::ClearRegisteredBenchmarks();
  benchmark::internal::Benchmark* run = benchmark::RegisterBenchmark(
      function.name.c_str(), [&function](benchmark::State& state) {
        for (auto _ : state) function.run();
      });
  run->MeasureProcessCPUTime();
  if (clock == Clock::kWall) run->UseRealTime();
  if (iterations > 0) {
    run->Iterations(iterations);
  } else {
    run->MinTime(min_time_s);
  }
  LastRun last(clock);
  benchmark::RunSpecifiedBenchmarks(&last, ".");
  return last;
}

}  // namespace

std::vector<Times> TimeInTurns(const std::vector<TimedFunction>& functions,
                               const TimingOptions& options,
                               Clock clock) {
  std::vector<std::int64_t> iterations;
  for (const TimedFunction& function : functions) {
    iterations.push_back(
        Run(function, 0, options.min_time_s, clock).iterations());
  }
  std::vector<Times> times(functions.size());
  for (int repetition = 0; repetition < options.repetitions; ++repetition) {
    for (std::size_t i = 0; i < functions.size(); ++i) {
      times[i].push_back(
          Run(functions[i], iterations[i], options.min_time_s, clock).ms());
    }
  }
  return times;
}

double Median(std::vector<double> values) {
  const auto middle =
      values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return (*middle + *std::max_element(values.begin(), middle)) / 2;
}

double MedianRatio(const Times& a, const Times& b) {
  std::vector<double> ratios;
  for (std::size_t i = 0; i < a.size(); ++i) ratios.push_back(a[i] / b[i]);
  return Median(ratios);
}

}  // namespace selfcal
