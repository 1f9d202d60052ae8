// What a process of its own costs a calibration, and how soon it is gone once
// it is not wanted any more. selfcald is the worker.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/simulation/simulate.h"
#include "core/simulation/trajectory.h"
#include "server/worker/worker.h"
#include "test/server/segment_source_of.h"

namespace selfcal::server {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kSegments = 16;

double MillisecondsSince(Clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(Clock::now() - begin)
      .count();
}

double Median(std::vector<double> values) {
  std::nth_element(
      values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

std::vector<MotionSegment> Segments(const Rig& rig) {
  SimulationOptions options;
  const double segment_s =
      options.keyframes_per_segment / options.keyframe_rate_hz;
  return Simulate(rig,
                  rig.factory,
                  rig.factory,
                  *MakeHandheld((kSegments + 1) * segment_s, 1.0, 1),
                  "session",
                  options)
      .segments;
}

void Measure(const std::string& selfcald, int trials) {
  const Rig rig = HandheldRig("rig");
  const auto segments = Segments(rig);
  const std::vector<std::string> command = {selfcald, kWorkerArgument};
  const auto go_on = [](const CalibrateProgress&) { return true; };
  WorkerLimits limits;
  limits.idle = false;
  const WorkerLimits idle;
  std::vector<double> here;
  std::vector<double> apart;
  std::vector<double> gone;
  for (int k = 0; k < trials; ++k) {
    auto begin = Clock::now();
    Calibrate(rig, rig.factory, segments, {}, go_on);
    here.push_back(MillisecondsSince(begin));
    begin = Clock::now();
    const auto result = CalibrateInWorker(
        command, limits, rig, rig.factory, SourceOf(segments), {}, go_on, {});
    apart.push_back(MillisecondsSince(begin));
    if (result->status != CalibrateStatus::kConverged) {
      throw std::runtime_error("the worker: " + result->message);
    }
    // At a moment of its own each time.
    const double wanted_ms = here.back() * (k + 0.5) / trials;
    Clock::time_point asked;
    begin = Clock::now();
    const auto cancelled = CalibrateInWorker(
        command, idle, rig, rig.factory, SourceOf(segments), {}, go_on, [&] {
          if (MillisecondsSince(begin) < wanted_ms) return false;
          asked = Clock::now();
          return true;
        });
    if (cancelled->status == CalibrateStatus::kCancelled) {
      gone.push_back(MillisecondsSince(asked));
    }
  }
  fmt::print("{} segments: {:.0f} ms here, {:.0f} ms in a worker\n",
             segments.size(),
             Median(here),
             Median(apart));
  fmt::print("gone after {:.1f} ms, at most {:.1f} ms ({} times)\n",
             Median(gone),
             *std::max_element(gone.begin(), gone.end()),
             gone.size());
}

}  // namespace
}  // namespace selfcal::server

int main(int argc, char** argv) {
  CLI::App app("What it costs to calibrate in a process of its own");
  std::string selfcald;
  int trials = 30;
  app.add_option("--selfcald", selfcald, "The program")->required();
  app.add_option("--trials", trials, "Of each")->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  selfcal::server::Measure(selfcald, trials);
}
