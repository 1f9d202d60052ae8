// Errors of the tracker on rendered recordings of several kinds, as a table.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "test/client/tracking/recording_kinds.h"
#include "test/client/tracking/track_errors.h"

namespace selfcal {
namespace {

void PrintDistribution(const std::string& kind,
                       const TrackedRecording& tracked) {
  const ErrorStatistics s = Summarise(tracked);
  fmt::print(
      "| {} | {:.3f} | {:.3f} | {:.3f} | {:.3f} | {:.3f} | {:.2f} / "
      "{:.2f} / {:.2f} / {:.2f} |\n",
      kind,
      s.median_px,
      s.p75_px,
      s.p90_px,
      s.p95_px,
      s.p99_px,
      CorrelationAfter(tracked, 2),
      CorrelationAfter(tracked, 10),
      CorrelationAfter(tracked, 20),
      CorrelationAfter(tracked, 40));
}

void Print(const RecordingKind& kind,
           double seconds,
           std::uint64_t seed,
           bool distribution) {
  const RenderedRecording recording = Render(kind, seconds, seed);
  const TrackedRecording tracked =
      TrackRecording(recording,
                     kind.start(recording.rig().factory),
                     kind.tracker,
                     recording.images());
  if (distribution) {
    PrintDistribution(kind.name, tracked);
    return;
  }
  const ErrorStatistics s = Summarise(tracked);
  std::size_t points = tracked.errors.size();
  fmt::print(
      "| {} | {:.0f} | {:.1f} | {:.2f} | {:.2f} | {:.2f} | {:.1f} | {:.1f} "
      "| {:.2f} | {:.2f} / {:.2f} / {:.2f} | {:.1f} |\n",
      kind.name,
      static_cast<double>(points) / (recording.images() * recording.cameras()),
      s.mean_length,
      s.median_px,
      s.sigma_px,
      s.p95_px,
      100 * s.outlier_share,
      100 * s.moving_share,
      s.correlation,
      SigmaAtAge(tracked, 1),
      SigmaAtAge(tracked, 10),
      SigmaAtAge(tracked, 40),
      tracked.cpu_ms);
  std::fflush(stdout);
}

}  // namespace
}  // namespace selfcal

int main(int argc, char** argv) {
  CLI::App app("Errors of the tracker on rendered recordings");
  double seconds = 20;
  std::uint64_t seed = 1;
  bool distribution = false;
  std::vector<std::string> names;
  app.add_option("kinds", names, "Kinds of recordings; all without any");
  app.add_option("--seconds", seconds)->check(CLI::PositiveNumber);
  app.add_option("--seed", seed);
  app.add_flag("--distribution",
               distribution,
               "Parts of the points, and correlations of a track's errors");
  CLI11_PARSE(app, argc, argv);
  cv::setNumThreads(1);
  if (distribution) {
    fmt::print(
        "| recording | 50 % [px] | 75 % | 90 % | 95 % | 99 % | correlation "
        "after 2 / 10 / 20 / 40 images |\n"
        "| --- | --- | --- | --- | --- | --- | --- |\n");
  } else {
    fmt::print(
        "| recording | points | length | median [px] | sigma [px] | 95 % [px] "
        "| outliers [%] | moving [%] | correlation | sigma at age 1 / 10 / 40 "
        "[px] | CPU [ms] |\n"
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- "
        "|\n");
  }
  for (const selfcal::RecordingKind& kind : selfcal::RecordingKinds()) {
    if (names.empty() ||
        std::find(names.begin(), names.end(), kind.name) != names.end()) {
      selfcal::Print(kind, seconds, seed, distribution);
    }
  }
}
