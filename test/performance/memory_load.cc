// The daemon's memory, and how long a device with small segments waits, while
// others send segments that are as large as a message may be. Each client has a
// connection and a rig of its own, and sends a refused segment again.
//
//   selfcal_memory_load --daemon build/release/server/daemon/selfcald
//       --folder DIR [--clients N] [--megabytes N] [--seconds N]
#include <fmt/format.h>
#include <grpcpp/create_channel.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "client/demo/daemon_view.h"
#include "core/simulation/simulate.h"
#include "core/simulation/trajectory.h"
#include "proto/convert.h"
#include "selfcal/v1/segment.grpc.pb.h"
#include "test/performance/load.h"
#include "test/server/large_segment.h"

namespace selfcal::client {
namespace {

struct Options : LoadOptions {
  int clients = 48;
  int megabytes = 48;  // of a segment on the wire
  int seconds = 60;
};

class Device {
 public:
  Device(const std::string& target,
         const std::string& rig,
         const v1::MotionSegment& segment) {
    request_.set_parent("rigs/" + rig);
    *request_.mutable_segment() = segment;
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    arguments.SetMaxSendMessageSize(-1);
    stub_ = v1::SegmentService::NewStub(grpc::CreateCustomChannel(
        target, grpc::InsecureChannelCredentials(), arguments));
  }

  // One after the other, with a pause between them.
  void Run(const std::atomic<bool>& stop, std::chrono::milliseconds pause) {
    while (!stop) {
      request_.mutable_segment()->set_index(
          static_cast<std::int64_t>(waits_.size()));
      const auto start = Clock::now();
      while (!stop && !Send()) {
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
      }
      if (!stop) waits_.push_back(Seconds(Clock::now() - start));
      std::this_thread::sleep_for(pause);
    }
    stream_.reset();
  }

  const std::vector<double>& waits() const { return waits_; }
  int refusals() const { return refusals_; }
  const std::string& refusal() const { return refusal_; }

 private:
  bool Send() {
    if (stream_ == nullptr) {
      context_ = std::make_unique<grpc::ClientContext>();
      stream_ = stub_->StreamSegments(context_.get());
    }
    v1::StreamSegmentsResponse response;
    if (stream_->Write(request_) && stream_->Read(&response)) {
      if (response.verdict() == v1::StreamSegmentsResponse::REJECTED) {
        throw std::runtime_error(response.ShortDebugString());
      }
      return true;
    }
    refusal_ = stream_->Finish().error_message();
    stream_.reset();
    ++refusals_;
    return false;
  }

  v1::StreamSegmentsRequest request_;
  std::unique_ptr<v1::SegmentService::Stub> stub_;
  std::unique_ptr<grpc::ClientContext> context_;
  std::unique_ptr<grpc::ClientReaderWriter<v1::StreamSegmentsRequest,
                                           v1::StreamSegmentsResponse>>
      stream_;
  std::vector<double> waits_;
  int refusals_ = 0;
  std::string refusal_;  // the last
};

std::string Quantiles(std::vector<double> waits) {
  if (waits.empty()) return "none";
  std::sort(waits.begin(), waits.end());
  const auto at = [&](double share) {
    return waits[static_cast<std::size_t>(
        share * static_cast<double>(waits.size() - 1))];
  };
  return fmt::format(
      "{} acknowledged; median {:.3f} s, 99 % {:.3f} s, longest {:.3f} s",
      waits.size(),
      at(0.5),
      at(0.99),
      waits.back());
}

void Run(const Options& options) {
  const std::unique_ptr<DaemonProcess> daemon = StartDaemon(options);

  const Rig simulated = HandheldRig("load");
  const auto trajectory = MakeHandheld(30.0, 1.0, 1);
  MotionSegment segment =
      Simulate(
          simulated, simulated.factory, simulated.factory, *trajectory, "s", {})
          .segments.front();
  const v1::MotionSegment small = ToProto(segment);
  const v1::MotionSegment large = ToProto(Enlarged(
      segment, static_cast<std::size_t>(options.megabytes) * 1'000'000));
  fmt::print("segments of {:.1f} and {:.3f} MB\n",
             1e-6 * static_cast<double>(large.ByteSizeLong()),
             1e-6 * static_cast<double>(small.ByteSizeLong()));

  std::vector<std::unique_ptr<Device>> devices;
  for (int k = 0; k <= options.clients; ++k) {
    const std::string rig = fmt::format("load{}", k);
    const absl::Status created =
        DaemonView(daemon->target(), rig).CreateRig(HandheldRig(rig));
    if (!created.ok()) throw std::runtime_error(created.ToString());
    devices.push_back(std::make_unique<Device>(
        daemon->target(), rig, k == 0 ? small : large));
  }
  fmt::print("idle: {:.0f} MiB\n", Memory(daemon->pid(), "VmRSS"));
  std::atomic<bool> stop = false;
  std::vector<std::thread> threads;
  for (std::size_t k = 0; k < devices.size(); ++k) {
    threads.emplace_back([&stop, k, device = devices[k].get()] {
      device->Run(stop, std::chrono::milliseconds(k == 0 ? 200 : 0));
    });
  }
  double largest = 0;
  const auto until = Clock::now() + std::chrono::seconds(options.seconds);
  while (Clock::now() < until) {
    largest = std::max(largest, Memory(daemon->pid(), "VmRSS"));
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  stop = true;
  for (std::thread& thread : threads) thread.join();
  fmt::print("resident memory: at most {:.0f} MiB ({:.0f} by the kernel)\n",
             largest,
             Memory(daemon->pid(), "VmHWM"));
  fmt::print("small: {}; refused {} {}\n",
             Quantiles(devices[0]->waits()),
             devices[0]->refusals(),
             devices[0]->refusal());
  std::vector<double> waits;
  int refusals = 0;
  std::string refusal;
  int fewest = devices.size() > 1 ? 1 << 30 : 0;
  for (std::size_t k = 1; k < devices.size(); ++k) {
    const auto& own = devices[k]->waits();
    waits.insert(waits.end(), own.begin(), own.end());
    fewest = std::min(fewest, static_cast<int>(own.size()));
    refusals += devices[k]->refusals();
    if (!devices[k]->refusal().empty()) refusal = devices[k]->refusal();
  }
  fmt::print("large: {}; of one client at least {}; refused {} {}\n",
             Quantiles(waits),
             fewest,
             refusals,
             refusal);
}

}  // namespace
}  // namespace selfcal::client

int main(int argc, char** argv) {
  CLI::App app("The daemon's memory under large segments");
  selfcal::client::Options options;
  selfcal::client::AddLoadOptions(&app, &options);
  app.add_option("--clients", options.clients, "With large segments")
      ->check(CLI::Range(0, 1000));
  app.add_option("--megabytes", options.megabytes)->check(CLI::Range(1, 60));
  app.add_option("--seconds", options.seconds)->check(CLI::Range(1, 86'400));
  CLI11_PARSE(app, argc, argv);
  return selfcal::client::RunLoad([&] { selfcal::client::Run(options); });
}
