// What a calibration costs where a map is used again: CPU time and memory, each
// case in a process of its own.
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/simulation/simulate.h"
#include "core/simulation/trajectory.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

struct MapCase {
  std::string name;
  Rig rig;
  int segments = 24;
  int every = 2;  // of so many segments of the session, one is used
  int landmarks_in_view = 120;
  double revisit_fraction = 0.1;
};

std::vector<MapCase> Cases() {
  const Rig mono = HandheldRig("mono");
  return {
      {"mono, nothing seen again", mono, 24, 2, 120, 0},
      {"mono, one track in ten seen again", mono, 24, 2, 120, 0.1},
      {"mono, a map for good", mono, 24, 2, 120, 0.9},
      {"mono, a map for good, neighbours", mono, 24, 1, 120, 0.9},
      {"stereo, 250 points a camera", StereoRig(), 16, 2, 250, 0.1},
      {"stereo, 250 points a camera, neighbours", StereoRig(), 16, 1, 250, 0.1},
      {"stereo, a map for good", StereoRig(), 16, 2, 250, 0.9},
  };
}

std::vector<MotionSegment> Segments(const MapCase& of) {
  SimulationOptions options;
  options.landmarks_in_view = of.landmarks_in_view;
  options.revisit_fraction = of.revisit_fraction;
  const int count = (of.segments - 1) * of.every + 1;
  const double duration_s =
      (count * options.keyframes_per_segment + 5) / options.keyframe_rate_hz;
  SimulatedSession session = Simulate(of.rig,
                                      of.rig.factory,
                                      PerturbCalibration(of.rig.factory, {}, 1),
                                      *MakeHandheld(duration_s, 0.7, 1),
                                      "session",
                                      options);
  std::vector<MotionSegment> segments;
  for (int s = 0; s < count; s += of.every) {
    segments.push_back(std::move(session.segments.at(s)));
  }
  return segments;
}

// Of the landmarks of a segment, those that another one sees as well.
double SharedFraction(const std::vector<MotionSegment>& segments) {
  std::map<std::uint64_t, int> seen_by;
  for (const MotionSegment& segment : segments) {
    for (const Landmark& landmark : segment.landmarks) ++seen_by[landmark.id];
  }
  double all = 0, shared = 0;
  for (const auto& [id, count] : seen_by) {
    all += count;
    if (count > 1) shared += count;
  }
  return shared / all;
}

double ResidentMebibytes() {
  std::ifstream file("/proc/self/statm");
  std::int64_t pages = 0;
  file >> pages >> pages;
  return static_cast<double>(pages * sysconf(_SC_PAGESIZE)) / (1 << 20);
}

// In a process of its own, whose memory is that of this case.
void Measure(const MapCase& of, bool noise_scales) {
  std::vector<MotionSegment> segments = Segments(of);
  Rig rig = of.rig;
  rig.factory = PerturbCalibration(of.rig.factory, {}, 1);
  CalibrateOptions options;
  options.noise_scales = noise_scales;
  const double before = ResidentMebibytes();
  const std::clock_t begin = std::clock();
  const CalibrationResult result =
      Calibrate(rig, rig.factory, segments, options);
  const double cpu_s = static_cast<double>(std::clock() - begin) /
                       static_cast<double>(CLOCKS_PER_SEC);
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  const double peak = static_cast<double>(usage.ru_maxrss) / 1024;
  const Eigen::VectorXd error = BoxMinus(result.theta, of.rig.factory);
  fmt::print(
      "{:<40} {:>3.0f} % shared, {:>3} partitions, {:>2} iterations, status "
      "{}: {:6.2f} s, {:5.0f} MiB more; NEES {:.1f} of {}\n",
      of.name,
      100 * SharedFraction(segments),
      result.partitions,
      result.iterations,
      static_cast<int>(result.status),
      cpu_s,
      peak - before,
      error.dot(result.covariance.ldlt().solve(error)),
      result.rank);
}

bool MeasureApart(const MapCase& of, bool noise_scales) {
  std::fflush(stdout);
  const pid_t child = fork();
  if (child == 0) {
    Measure(of, noise_scales);
    std::fflush(stdout);
    std::_Exit(EXIT_SUCCESS);
  }
  int status = 0;
  waitpid(child, &status, 0);
  const bool done = WIFEXITED(status) && WEXITSTATUS(status) == EXIT_SUCCESS;
  if (!done) fmt::print("{}: the process ended with {}\n", of.name, status);
  return done;
}

}  // namespace
}  // namespace selfcal

int main(int argc, char** argv) {
  CLI::App app("What a calibration costs where a map is used again");
  std::string only;
  bool noise_scales = true;
  app.add_option("--only", only, "Cases whose names begin so");
  app.add_flag("!--no-noise-factors", noise_scales, "Leave them out");
  CLI11_PARSE(app, argc, argv);
  bool done = true;
  for (const selfcal::MapCase& of : selfcal::Cases()) {
    if (of.name.starts_with(only)) {
      done = selfcal::MeasureApart(of, noise_scales) && done;
    }
  }
  return done ? EXIT_SUCCESS : EXIT_FAILURE;
}
