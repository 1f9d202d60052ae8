// The worker process.
#include <fmt/format.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdlib>
#include <exception>
#include <fstream>
#include <new>
#include <stdexcept>
#include <utility>
#include <vector>

#include "server/worker/channel.h"
#include "server/worker/idle_process.h"
#include "server/worker/job.h"
#include "server/worker/worker.h"

namespace selfcal::server {
namespace {

// The daemon decides when the worker ends; signals to the whole process group
// or service are ignored.
void IgnoreStopSignals() {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  for (const int stop : {SIGTERM, SIGINT, SIGHUP}) {
    signal(stop, SIG_IGN);
  }
}

// When memory runs out, the system kills this process rather than the daemon.
void PreferOomKill() { std::ofstream("/proc/self/oom_score_adj") << 1000; }

// Returns the size of the data that the process has mapped.
std::int64_t DataBytes() {
  std::ifstream file("/proc/self/statm");
  std::int64_t pages = 0;
  for (int column = 0; column < 6; ++column) file >> pages;
  return pages * sysconf(_SC_PAGESIZE);
}

void LimitMemory(std::int64_t bytes) {
  if (bytes == 0) return;
  const auto most = static_cast<rlim_t>(DataBytes() + bytes);
  const rlimit limit{.rlim_cur = most, .rlim_max = most};
  setrlimit(RLIMIT_DATA, &limit);
}

// Sends the progress; returns false if the daemon no longer reads it.
bool ReportProgress(const CalibrateProgress& progress) {
  const std::string bytes = EncodeProgress(progress);
  return send(kProgressFile, bytes.data(), bytes.size(), MSG_NOSIGNAL) ==
         static_cast<ssize_t>(bytes.size());
}

CalibrationResult Failure(std::string message) {
  CalibrationResult result;
  result.message = std::move(message);
  return result;
}

std::vector<MotionSegment> ReceiveSegments() {
  std::vector<MotionSegment> segments;
  while (const auto part = ReceivePart(kJobFile)) {
    auto segment = DecodeSegment(*part);
    if (!segment) throw std::runtime_error("a segment cannot be read");
    segments.push_back(*std::move(segment));
  }
  return segments;
}

std::string Compute(const Job& job) {
  const std::vector<MotionSegment> segments = ReceiveSegments();
  if (job.scorer) {
    return EncodeScore(
        ScoreSegmentBy(*job.scorer, job.rig, job.theta_start, segments.at(0)));
  }
  return EncodeResult(Calibrate(
      job.rig, job.theta_start, segments, job.options, ReportProgress));
}

// Computes the job and returns the bytes of the result.
std::string Solve(const Job& job) {
  LimitMemory(job.limits.max_memory_bytes);
  try {
    return Compute(job);
  } catch (const std::bad_alloc&) {
    return EncodeResult(Failure(fmt::format(
        "it exceeds the memory limit of a run of {} MiB; smaller tables need "
        "less",
        job.limits.max_memory_bytes >> 20)));
  } catch (const std::exception& error) {
    return EncodeResult(Failure(error.what()));
  }
}

}  // namespace

int RunWorker() {
  IgnoreStopSignals();
  PreferOomKill();
  const auto job = DecodeJob(ReceivePart(kJobFile).value_or(""));
  if (!job) {
    return EXIT_FAILURE;
  }
  job->limits.idle ? BecomeIdle() : LowerPriority();
  WriteWhole(kResultFile, Solve(*job));
  return EXIT_SUCCESS;
}

}  // namespace selfcal::server
