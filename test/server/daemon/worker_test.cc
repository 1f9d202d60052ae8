// A run's process that dies or stands still, under a daemon that lives on.
#include <gmock/gmock.h>
#include <signal.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "test/promise.h"
#include "test/server/daemon/daemon_fixture.h"

namespace selfcal::server {
namespace {

class DaemonsWorkerTest : public DaemonTest {
 protected:
  void SetUp() override {
    daemon_ = StartAndWait({"--run-priority", "low"});
    Rig rig = TestRig("r");
    rig.table_size = 50;  // never full: no run but those that are started here
    CreateRig(rig);
    Stream(TestSegments(rig, 3));
    ASSERT_TRUE(AllScored());
  }

  // Starts a run and sends the signal to its process; the name of the run. A
  // run may be over before its process is found: then another.
  std::string StartAndSignal(int signal) {
    for (;;) {
      grpc::ClientContext context;
      v1::StartRecalibrationRequest request;
      request.set_parent("rigs/r");
      v1::Recalibration run;
      const auto stub = v1::RecalibrationService::NewStub(channel_);
      const auto status = stub->StartRecalibration(&context, request, &run);
      if (!status.ok()) {
        ADD_FAILURE() << status.error_message();
        return "";
      }
      if (SignalWorker(signal)) return run.name();
      WatchToTheEnd(run.name());
    }
  }

  std::unique_ptr<Process> daemon_;

 private:
  // It is the daemon itself until it has started its program.
  static bool HasBegun(pid_t worker) {
    std::ifstream file("/proc/" + std::to_string(worker) + "/cmdline");
    std::string command;
    std::getline(file, command);
    return command.find("--worker") != command.npos;
  }

  // Whether there was one within half a second.
  bool SignalWorker(int signal) const {
    namespace fs = std::filesystem;
    const auto end =
        std::chrono::steady_clock::now() + std::chrono::milliseconds(500);
    while (std::chrono::steady_clock::now() < end) {
      const fs::path tasks =
          fs::path("/proc") / std::to_string(daemon_->pid()) / "task";
      for (const auto& task : fs::directory_iterator(tasks)) {
        std::ifstream children(task.path() / "children");
        if (pid_t worker = 0; children >> worker && HasBegun(worker)) {
          return kill(worker, signal) == 0;
        }
      }
    }
    return false;
  }
};

TEST_F(DaemonsWorkerTest, ItsEndFailsTheRunAndNothingElse) {
  Promise promise("a solver that dies leaves the daemon alone");
  for (int trials = Trials(3); promise.trials < trials; ++promise.trials) {
    const std::string name = StartAndSignal(SIGKILL);
    const v1::Recalibration run = WatchToTheEnd(name);
    const bool kept = run.state() == v1::Recalibration::FAILED &&
                      run.message().find("signal 9") != std::string::npos &&
                      Segments().segments_size() == 3;
    promise.lost += kept ? 0 : 1;
    EXPECT_TRUE(kept) << run.ShortDebugString();
  }
}

// Nothing that the solver does or leaves undone holds a cancellation up.
TEST_F(DaemonsWorkerTest, OneThatStandsStillIsCancelled) {
  Promise promise("a run is cancelled whatever its solver does");
  for (int trials = Trials(3); promise.trials < trials; ++promise.trials) {
    grpc::ClientContext context;
    v1::CancelRecalibrationRequest request;
    request.set_name(StartAndSignal(SIGSTOP));
    v1::Recalibration run;
    const auto stub = v1::RecalibrationService::NewStub(channel_);
    const auto status = stub->CancelRecalibration(&context, request, &run);
    EXPECT_TRUE(status.ok()) << status.error_message();
    run = WatchToTheEnd(request.name());
    promise.lost += run.state() == v1::Recalibration::CANCELLED ? 0 : 1;
  }
}

// As a stop of the service: the run begins again with the next start.
TEST_F(DaemonsWorkerTest, OneThatStandsStillDoesNotHoldUpAStop) {
  const std::string name = StartAndSignal(SIGSTOP);
  daemon_->Signal(SIGTERM);
  EXPECT_EQ(daemon_->Wait(), 0);
  daemon_ = StartAndWait({"--run-priority", "low"});
  const v1::Recalibration run = WatchToTheEnd(name);
  EXPECT_EQ(run.state(), v1::Recalibration::SUCCEEDED) << run.message();
}

}  // namespace
}  // namespace selfcal::server
