#include "server/worker/worker.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <spawn.h>
#include <spdlog/spdlog.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <optional>
#include <system_error>
#include <thread>
#include <utility>

#include "server/status/status_macros.h"
#include "server/worker/channel.h"
#include "server/worker/job.h"

extern char** environ;

namespace selfcal::server {
namespace {

std::system_error SystemError(const char* what) {
  return {errno, std::generic_category(), what};
}

class Descriptor {
 public:
  // Moves the descriptor above the numbers that the worker uses, so that none
  // is overwritten when they are assigned.
  Descriptor(int file, const char* what) {
    if (file < 0) throw SystemError(what);
    file_ = fcntl(file, F_DUPFD_CLOEXEC, kFirstFreeFile);
    close(file);
    if (file_ < 0) throw SystemError(what);
  }
  ~Descriptor() { Close(); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  int get() const { return file_; }
  void Close() {
    if (file_ >= 0) close(file_);
    file_ = -1;
  }

 private:
  int file_ = -1;
};

// Creates an anonymous file.
Descriptor MakeFile(const char* name) {
  return {memfd_create(name, MFD_CLOEXEC), "memfd_create"};
}

struct Sockets {
  // SOCK_STREAM or SOCK_SEQPACKET
  explicit Sockets(int type) : Sockets(Pair(type)) {}
  explicit Sockets(const std::array<int, 2>& pair)
      : ours(pair[0], "socketpair"), workers(pair[1], "socketpair") {}

  static std::array<int, 2> Pair(int type) {
    std::array<int, 2> pair{-1, -1};
    if (socketpair(AF_UNIX, type | SOCK_CLOEXEC, 0, pair.data()) != 0) {
      throw SystemError("socketpair");
    }
    return pair;
  }

  Descriptor ours;
  Descriptor workers;
};

class Process {
 public:
  Process(const std::vector<std::string>& command,
          int job,
          int progress,
          int result) {
    std::vector<std::string> arguments = command;
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, job, kJobFile);
    posix_spawn_file_actions_adddup2(&actions, STDERR_FILENO, STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&actions, progress, kProgressFile);
    posix_spawn_file_actions_adddup2(&actions, result, kResultFile);
    posix_spawn_file_actions_addclosefrom_np(&actions, kFirstFreeFile);
    const int error =
        posix_spawn(&pid_, argv[0], &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) {
      errno = error;
      throw SystemError("cannot start the solver");
    }
  }
  // Kills the process, but does not block until it has ended: it has to be
  // scheduled to die, and at idle priority on a busy machine that may take many
  // seconds.
  ~Process() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    const sched_param parameters{};
    sched_setscheduler(pid_, SCHED_OTHER, &parameters);  // faster, if permitted
    if (!EndsWithin(kPatience)) WaitAside(pid_);
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  // Waits like waitpid().
  int Wait() {
    const int status = WaitFor(pid_);
    pid_ = 0;
    return status;
  }

 private:
  static constexpr std::chrono::milliseconds kPatience{200};

  static int WaitFor(pid_t pid) {
    int status = 0;
    while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
    }
    return status;
  }

  // Waits on another thread: the process holds nothing that is needed. If no
  // thread can be started, it remains a zombie until the daemon ends.
  static void WaitAside(pid_t pid) {
    try {
      std::thread([pid] { WaitFor(pid); }).detach();
    } catch (const std::system_error& error) {
      spdlog::warn("cannot wait for a solver process that was killed: {}",
                   error.what());
    }
  }

  bool EndsWithin(std::chrono::milliseconds time) const {
    constexpr std::chrono::milliseconds kStep{2};
    for (; time.count() > 0; time -= kStep) {
      if (waitpid(pid_, nullptr, WNOHANG) != 0) return true;
      std::this_thread::sleep_for(kStep);
    }
    return false;
  }

  pid_t pid_ = 0;
};

// The outcome of a worker: the bytes of its result, or why there are none.
struct Finished {
  CalibrateStatus status = CalibrateStatus::kFailed;
  std::string message;
  std::string result;
};

std::string WhyItEnded(int status) {
  return WIFSIGNALED(status)
             ? fmt::format("its process ended by signal {} ({})",
                           WTERMSIG(status),
                           strsignal(WTERMSIG(status)))
             : fmt::format("its process ended with exit code {}",
                           WEXITSTATUS(status));
}

// Forwards progress until the worker closes its end. Returns false if the
// worker is no longer needed.
bool Follow(int socket,
            const ProgressCallback& progress,
            const std::function<bool()>& interrupted) {
  std::vector<char> buffer(kMaxProgressBytes);
  for (;;) {
    if (interrupted && interrupted()) {
      return false;
    }
    pollfd polled{.fd = socket, .events = POLLIN, .revents = 0};
    if (poll(&polled, 1, kPollMs) <= 0) {
      continue;
    }
    const ssize_t size = recv(socket, buffer.data(), buffer.size(), 0);
    if (size <= 0) {
      return true;
    }
    const auto received =
        DecodeProgress({buffer.data(), static_cast<std::size_t>(size)});
    if (received && progress && !progress(*received)) {
      return false;
    }
  }
}

// Sends the job and its segments. Returns an error of `segments`.
absl::StatusOr<Sending> SendJob(int socket,
                                const Job& job,
                                const SegmentSource& segments,
                                const std::function<bool()>& interrupted) {
  Sending sent = SendPart(socket, EncodeJob(job), interrupted);
  while (sent == Sending::kDone) {
    SELFCAL_ASSIGN_OR_RETURN(std::optional<MotionSegment> segment, segments());
    if (!segment) return SendPart(socket, "", interrupted);
    const std::string part = EncodeSegment(*segment);
    segment.reset();  // not needed while the worker receives it
    sent = SendPart(socket, part, interrupted);
  }
  return sent;
}

// Returns an error of `segments`.
absl::StatusOr<Finished> RunJob(const std::vector<std::string>& command,
                                const Job& job,
                                const SegmentSource& segments,
                                const ProgressCallback& progress,
                                const std::function<bool()>& interrupted) {
  Sockets jobs(SOCK_STREAM);
  Sockets reports(SOCK_SEQPACKET);
  const Descriptor result = MakeFile("selfcal-result");
  Process process(
      command, jobs.workers.get(), reports.workers.get(), result.get());
  jobs.workers.Close();
  reports.workers.Close();
  SELFCAL_ASSIGN_OR_RETURN(
      const Sending sent, SendJob(jobs.ours.get(), job, segments, interrupted));
  // A worker that has not read all of it has ended, or is about to.
  if (sent == Sending::kInterrupted ||
      !Follow(reports.ours.get(), progress, interrupted)) {
    return Finished{CalibrateStatus::kCancelled, "cancelled", ""};
  }
  if (const int status = process.Wait(); status != 0) {
    return Finished{CalibrateStatus::kFailed, WhyItEnded(status), ""};
  }
  return Finished{CalibrateStatus::kConverged, "", ReadWhole(result.get())};
}

}  // namespace

absl::StatusOr<CalibrationResult> CalibrateInWorker(
    const std::vector<std::string>& command,
    const WorkerLimits& limits,
    const Rig& rig,
    const Calibration& theta_start,
    const SegmentSource& segments,
    const CalibrateOptions& options,
    const ProgressCallback& progress,
    const std::function<bool()>& interrupted) {
  SELFCAL_ASSIGN_OR_RETURN(Finished finished,
                           RunJob(command,
                                  {rig, theta_start, options, limits},
                                  segments,
                                  progress,
                                  interrupted));
  if (finished.status == CalibrateStatus::kConverged) {
    auto read = DecodeResult(finished.result);
    if (read) return *std::move(read);
    finished = {
        CalibrateStatus::kFailed, "its process ended without a result", ""};
  }
  CalibrationResult result;
  result.status = finished.status;
  result.message = std::move(finished.message);
  return result;
}

absl::StatusOr<SegmentInformation> ScoreInWorker(
    const std::vector<std::string>& command,
    const WorkerLimits& limits,
    ScorerKind scorer,
    const Rig& rig,
    const Calibration& theta0,
    const MotionSegment& segment,
    const std::function<bool()>& interrupted) {
  const SegmentSource once =
      [&,
       sent = false]() mutable -> absl::StatusOr<std::optional<MotionSegment>> {
    if (std::exchange(sent, true)) return std::nullopt;
    return segment;
  };
  SELFCAL_ASSIGN_OR_RETURN(
      const Finished finished,
      RunJob(command,
             {rig, theta0, CalibrateOptions(), limits, scorer},
             once,
             nullptr,
             interrupted));
  if (finished.status == CalibrateStatus::kConverged) {
    return DecodeScore(finished.result);
  }
  return finished.status == CalibrateStatus::kCancelled
             ? absl::CancelledError(finished.message)
             : absl::InternalError(finished.message);
}

}  // namespace selfcal::server
