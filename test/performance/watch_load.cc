// Many watches of one rig on a real daemon: its threads and resident memory,
// and how long after an activation each watcher has the new version.
//
//   selfcal_watch_load --daemon build/release/server/daemon/selfcald
//       --folder DIR [--watches N] [--activations N]
//
// The daemon takes its other settings from the environment: with SELFCAL_STORE
// it is a replica of a hub.
#include <fmt/format.h>
#include <grpcpp/create_channel.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "client/demo/daemon_view.h"
#include "core/simulation/simulate.h"
#include "core/simulation/trajectory.h"
#include "proto/convert.h"
#include "selfcal/v1/calibration_service.grpc.pb.h"
#include "selfcal/v1/segment.grpc.pb.h"
#include "test/performance/load.h"

namespace selfcal::client {
namespace {

constexpr int kWatchesOfAConnection = 100;

struct Options : LoadOptions {
  int watches = 10'000;
  int activations = 5;
};

// One watch; counts the versions that it has been sent.
class Watcher final : public grpc::ClientReadReactor<v1::Calibration> {
 public:
  Watcher(v1::CalibrationService::Stub* stub, const std::string& rig) {
    v1::WatchCalibrationRequest request;
    request.set_parent("rigs/" + rig);
    request_ = request;
    stub->async()->WatchCalibration(&context_, &request_, this);
    StartRead(&version_);
    StartCall();
  }

  void OnReadDone(bool ok) override {
    if (!ok) return;
    last_ = Clock::now();
    ++received_;
    StartRead(&version_);
  }
  void OnDone(const grpc::Status& /*status*/) override { done_ = true; }

  void Cancel() { context_.TryCancel(); }
  int received() const { return received_; }
  bool done() const { return done_; }
  Clock::time_point last() const { return last_; }

 private:
  grpc::ClientContext context_;
  v1::WatchCalibrationRequest request_;
  v1::Calibration version_;
  std::atomic<int> received_ = 0;
  std::atomic<bool> done_ = false;
  std::atomic<Clock::time_point> last_{Clock::time_point()};
};

// Ends its watches before it removes them, also when the program fails.
class Watchers {
 public:
  ~Watchers() {
    for (const auto& watcher : all_) watcher->Cancel();
    for (const auto& watcher : all_) {
      while (!watcher->done()) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
    }
  }
  Watchers() = default;
  Watchers(const Watchers&) = delete;
  Watchers& operator=(const Watchers&) = delete;

  void Add(v1::CalibrationService::Stub* stub, const std::string& rig) {
    all_.push_back(std::make_unique<Watcher>(stub, rig));
  }
  bool HaveAll(int versions) const {
    return std::all_of(all_.begin(), all_.end(), [&](const auto& watcher) {
      return watcher->received() >= versions;
    });
  }
  const std::vector<std::unique_ptr<Watcher>>& all() const { return all_; }

 private:
  std::vector<std::unique_ptr<Watcher>> all_;
};

void WaitUntil(const std::function<bool()>& condition) {
  const auto end = Clock::now() + std::chrono::minutes(2);
  while (!condition()) {
    if (Clock::now() > end) throw std::runtime_error("waited for 2 minutes");
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

std::shared_ptr<grpc::Channel> Connect(const std::string& target) {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  return grpc::CreateCustomChannel(
      target, grpc::InsecureChannelCredentials(), arguments);
}

// A rig with two versions, of which either can be activated.
void MakeTwoVersions(const std::string& target, const std::string& id) {
  const Rig rig = HandheldRig(id);
  DaemonView view(target, id);
  const auto check = [](const absl::Status& status) {
    if (!status.ok()) throw std::runtime_error(status.ToString());
  };
  check(view.CreateRig(rig));
  // Too few for full tables, whose run waits for an idle machine.
  const auto trajectory = MakeHandheld(28.0, 1.0, 1);
  const auto segments =
      Simulate(rig, rig.factory, rig.factory, *trajectory, "s", {}).segments;
  grpc::ClientContext context;
  const auto stub = v1::SegmentService::NewStub(Connect(target));
  const auto stream = stub->StreamSegments(&context);
  for (const MotionSegment& segment : segments) {
    v1::StreamSegmentsRequest request;
    request.set_parent("rigs/" + id);
    *request.mutable_segment() = ToProto(segment);
    v1::StreamSegmentsResponse response;
    stream->Write(request);
    stream->Read(&response);
  }
  stream->WritesDone();
  static_cast<void>(stream->Finish());
  WaitUntil([&] { return view.StartRun().ok(); });
  WaitUntil([&] {
    const auto runs = view.GetRuns();
    return runs.ok() && !runs->empty() &&
           runs->back().state() == v1::Recalibration::SUCCEEDED &&
           runs->front().state() == v1::Recalibration::SUCCEEDED;
  });
}

void Run(const Options& options) {
  const std::unique_ptr<DaemonProcess> daemon = StartDaemon(options);
  const std::string rig = "watched";
  MakeTwoVersions(daemon->target(), rig);
  // Its memory settles, and no run is under way any more.
  std::this_thread::sleep_for(std::chrono::seconds(5));
  const double memory = StatusOf(daemon->pid(), "VmRSS");
  const double threads = StatusOf(daemon->pid(), "Threads");

  std::vector<std::unique_ptr<v1::CalibrationService::Stub>> stubs;
  Watchers watchers;
  for (int k = 0; k < options.watches; ++k) {
    if (k % kWatchesOfAConnection == 0) {
      stubs.push_back(
          v1::CalibrationService::NewStub(Connect(daemon->target())));
    }
    watchers.Add(stubs.back().get(), rig);
  }
  WaitUntil([&] { return watchers.HaveAll(1); });
  fmt::print(
      "{} watches on {} connections: {:.1f} KiB of the daemon's resident "
      "memory "
      "for each; threads {} before, {} with them\n",
      options.watches,
      stubs.size(),
      (StatusOf(daemon->pid(), "VmRSS") - memory) / options.watches,
      threads,
      StatusOf(daemon->pid(), "Threads"));

  std::vector<double> latencies;
  const auto admin = v1::CalibrationService::NewStub(Connect(daemon->target()));
  for (int k = 0; k < options.activations; ++k) {
    v1::ActivateCalibrationRequest request;
    request.set_name(
        fmt::format("rigs/{}/calibrations/{}", rig, k % 2 == 0 ? 1 : 2));
    request.set_reason("measured");
    grpc::ClientContext context;
    v1::Calibration active;
    const auto begin = Clock::now();
    const grpc::Status status =
        admin->ActivateCalibration(&context, request, &active);
    if (!status.ok()) throw std::runtime_error(status.error_message());
    WaitUntil([&] { return watchers.HaveAll(k + 2); });
    for (const auto& watcher : watchers.all()) {
      latencies.push_back(
          std::chrono::duration<double>(watcher->last() - begin).count());
    }
  }
  std::sort(latencies.begin(), latencies.end());
  fmt::print(
      "after {} activations each watcher had the new version in {:.3f} s "
      "(median), {:.3f} s (99th percentile), {:.3f} s (longest)\n",
      options.activations,
      latencies[latencies.size() / 2],
      latencies[latencies.size() * 99 / 100],
      latencies.back());
}

}  // namespace
}  // namespace selfcal::client

int main(int argc, char** argv) {
  CLI::App app("The daemon with many watches");
  selfcal::client::Options options;
  selfcal::client::AddLoadOptions(&app, &options);
  app.add_option("--watches", options.watches)->check(CLI::Range(1, 1'000'000));
  app.add_option("--activations", options.activations)
      ->check(CLI::Range(1, 1000));
  CLI11_PARSE(app, argc, argv);
  return selfcal::client::RunLoad([&] { selfcal::client::Run(options); });
}
