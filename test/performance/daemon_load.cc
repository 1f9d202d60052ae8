// The daemon with its default settings, but for the priority of runs, under
// clients that send as fast as it acknowledges: whether each gets on, and the
// daemon's resident memory.
//
//   selfcal_daemon_load --daemon build/release/server/daemon/selfcald
//       --folder DIR [--clients N] [--seconds N] [--replica ADDRESS...]
//
// Replicas are other daemons on the same database, which SELFCAL_STORE names:
// each of them, and the daemon that is started, serves as many of the clients.
#include <fmt/format.h>
#include <grpcpp/create_channel.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "client/demo/daemon_view.h"
#include "core/simulation/simulate.h"
#include "core/simulation/trajectory.h"
#include "proto/convert.h"
#include "selfcal/v1/segment.grpc.pb.h"
#include "test/performance/load.h"

namespace selfcal::client {
namespace {

using std::chrono::seconds;

struct Options : LoadOptions {
  int clients = 200;
  int seconds = 60;
  int unacknowledged = 4;  // of one client, as the library's default
  std::vector<std::string> replicas;
};

// A device with a connection and a rig of its own; its recording restarts
// as another session.
class Device {
 public:
  Device(const std::string& target,
         std::string rig,
         const std::vector<MotionSegment>& recording)
      : rig_(std::move(rig)), recording_(recording) {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    stub_ = v1::SegmentService::NewStub(grpc::CreateCustomChannel(
        target, grpc::InsecureChannelCredentials(), arguments));
  }

  void Stream(Clock::time_point until, int unacknowledged) {
    grpc::ClientContext context;
    const auto stream = stub_->StreamSegments(&context);
    last_ = Clock::now();
    int sent = 0;
    bool open = true;
    while (open && Clock::now() < until) {
      open = sent - answered_ < unacknowledged ? stream->Write(Request(sent++))
                                               : TakeAnswer(stream.get());
    }
    stream->WritesDone();
    while (TakeAnswer(stream.get())) {
    }
    status_ = stream->Finish();
    if (answered_ < sent) unanswered_ = sent - answered_;
  }

  int stored() const { return stored_; }
  int rejected() const { return answered_ - stored_; }
  int unanswered() const { return unanswered_; }
  const grpc::Status& status() const { return status_; }
  double longest_wait_s() const { return Seconds(longest_); }

 private:
  v1::StreamSegmentsRequest Request(int k) const {
    const auto count = static_cast<int>(recording_.size());
    v1::StreamSegmentsRequest request;
    request.set_parent("rigs/" + rig_);
    *request.mutable_segment() = ToProto(recording_[k % count]);
    request.mutable_segment()->set_session(fmt::format("s{}", k / count));
    request.mutable_segment()->set_index(k % count);
    return request;
  }

  template <typename Stream>
  bool TakeAnswer(Stream* stream) {
    v1::StreamSegmentsResponse response;
    if (!stream->Read(&response)) return false;
    const auto now = Clock::now();
    longest_ = std::max(longest_, now - last_);
    last_ = now;
    ++answered_;
    if (response.verdict() == v1::StreamSegmentsResponse::STORED) ++stored_;
    return true;
  }

  const std::string rig_;
  const std::vector<MotionSegment>& recording_;
  std::unique_ptr<v1::SegmentService::Stub> stub_;
  grpc::Status status_;
  int answered_ = 0;
  int stored_ = 0;
  int unanswered_ = 0;
  Clock::time_point last_;
  Clock::duration longest_{0};
};

// The largest resident memory of the daemon while they stream, in MiB.
double StreamAll(const Options& options,
                 pid_t daemon,
                 std::vector<std::unique_ptr<Device>>* devices) {
  const auto until = Clock::now() + seconds(options.seconds);
  std::vector<std::thread> threads;
  threads.reserve(devices->size());
  for (auto& device : *devices) {
    threads.emplace_back([&options, until, raw = device.get()] {
      raw->Stream(until, options.unacknowledged);
    });
  }
  double largest = 0;
  while (Clock::now() < until) {
    largest = std::max(largest, Memory(daemon, "VmRSS"));
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  for (std::thread& thread : threads) thread.join();
  return largest;
}

void PrintDevices(const Options& options,
                  const std::vector<std::unique_ptr<Device>>& devices) {
  std::vector<int> stored;
  int rejected = 0;
  int unanswered = 0;
  double longest = 0;
  std::map<std::string, int> endings;
  for (const auto& device : devices) {
    stored.push_back(device->stored());
    rejected += device->rejected();
    unanswered += device->unanswered();
    longest = std::max(longest, device->longest_wait_s());
    ++endings[device->status().ok() ? "OK" : device->status().error_message()];
  }
  std::sort(stored.begin(), stored.end());
  int sum = 0;
  for (const int count : stored) sum += count;
  fmt::print(
      "clients {}: {} segments stored in {} s, {:.1f}/s; of one client {} to "
      "{}, median {}; refused {}, unanswered {}; longest wait for an answer "
      "{:.1f} s\n",
      devices.size(),
      sum,
      options.seconds,
      static_cast<double>(sum) / options.seconds,
      stored.front(),
      stored.back(),
      stored[stored.size() / 2],
      rejected,
      unanswered,
      longest);
  for (const auto& [ending, count] : endings) {
    fmt::print("  {} streams ended with {}\n", count, ending);
  }
}

// Long enough that a rig does not see the same noise over and over, which it
// would take for a change.
std::vector<MotionSegment> Record() {
  const Rig rig = HandheldRig("load");
  const auto trajectory = MakeHandheld(900.0, 1.0, 1);
  return Simulate(rig, rig.factory, rig.factory, *trajectory, "s", {}).segments;
}

void Run(const Options& options) {
  const std::unique_ptr<DaemonProcess> daemon = StartDaemon(options);
  std::this_thread::sleep_for(seconds(2));
  const double idle = Memory(daemon->pid(), "VmRSS");

  const std::vector<MotionSegment> recording = Record();
  std::vector<std::string> targets = {daemon->target()};
  targets.insert(
      targets.end(), options.replicas.begin(), options.replicas.end());
  std::vector<std::unique_ptr<Device>> devices;
  for (int k = 0; k < options.clients; ++k) {
    const std::string& target = targets[k % targets.size()];
    const std::string rig = fmt::format("load{}", k);
    const absl::Status created =
        DaemonView(target, rig).CreateRig(HandheldRig(rig));
    if (!created.ok()) throw std::runtime_error(created.ToString());
    devices.push_back(std::make_unique<Device>(target, rig, recording));
  }
  fmt::print("{} clients begin\n", devices.size());
  std::fflush(stdout);
  const double busy = StreamAll(options, daemon->pid(), &devices);
  PrintDevices(options, devices);
  std::fflush(stdout);
  devices.clear();
  std::this_thread::sleep_for(seconds(10));
  fmt::print(
      "resident memory of the daemon: {:.0f} MiB idle after its start, at most "
      "{:.0f} MiB while they stream, {:.0f} MiB 10 s after; the largest ever "
      "{:.0f} MiB\n",
      idle,
      busy,
      Memory(daemon->pid(), "VmRSS"),
      Memory(daemon->pid(), "VmHWM"));
}

}  // namespace
}  // namespace selfcal::client

int main(int argc, char** argv) {
  CLI::App app("The daemon under many clients, and its memory");
  selfcal::client::Options options;
  selfcal::client::AddLoadOptions(&app, &options);
  app.add_option("--clients", options.clients)->check(CLI::Range(1, 1000));
  app.add_option("--seconds", options.seconds)->check(CLI::Range(1, 86'400));
  app.add_option("--replica", options.replicas, "Address of another daemon");
  CLI11_PARSE(app, argc, argv);
  return selfcal::client::RunLoad([&] { selfcal::client::Run(options); });
}
