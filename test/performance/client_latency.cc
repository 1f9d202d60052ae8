// How long a SLAM process waits for the client: AddImu and AddKeyframe, each
// with the sending of what they complete, while the daemon is absent, stalled
// (stopped by a signal in the middle of its work) and busy (as many segments as
// it takes). The session runs faster than real time, so that more segments
// close in the same time than on a device.
//
//   selfcal_client_latency --daemon build/release/server/daemon/selfcald
#include <fmt/format.h>
#include <signal.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <functional>
#include <iostream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "client/demo/daemon_view.h"
#include "client/process/daemon_process.h"
#include "client/selfcal/client.h"
#include "client/selfcal/segment_builder.h"
#include "core/simulation/simulate.h"
#include "test/support/temp_folder.h"
#include "test/system/looped_session.h"

namespace selfcal::client {
namespace {

using Clock = std::chrono::steady_clock;

struct Options {
  std::string daemon;
  int keyframes = 20'000;
  std::chrono::microseconds pace{1000};  // between keyframes
};

enum class Daemon { kAbsent, kStalled, kBusy };

class Times {
 public:
  void Add(Clock::duration time) {
    us_.push_back(std::chrono::duration<double, std::micro>(time).count());
  }
  std::string Line(const std::string& name) {
    std::sort(us_.begin(), us_.end());
    const auto quantile = [&](double q) {
      return us_[static_cast<std::size_t>(q *
                                          static_cast<double>(us_.size() - 1))];
    };
    return fmt::format("{:<24}{:>9}{:>9.2f}{:>9.2f}{:>9.2f}{:>10.1f}",
                       name,
                       us_.size(),
                       quantile(0.5),
                       quantile(0.99),
                       quantile(0.999),
                       us_.back());
  }

 private:
  std::vector<double> us_;
};

// The same calls for every daemon, and for none: the clock itself, which shows
// what the machine adds.
struct Measured {
  Times clock;
  Times add_imu;
  Times add_keyframe;
  Times close;  // those calls of the two that completed a segment
};

Measured Run(const Options& options,
             const ClientOptions& client,
             const Rig& rig,
             const std::function<void()>& before_end,
             StreamStatistics* statistics) {
  Measured measured;
  SegmentStream stream(client, nullptr);
  SegmentBuilder builder({.session = "latency"});
  LoopedSession session(rig, rig.factory);
  const auto measure = [&](Times* times, const auto& add) {
    bool closed_one = false;
    const auto begin = Clock::now();
    add();
    while (auto closed = builder.TakeClosed()) {
      stream.Send(*std::move(closed));
      closed_one = true;
    }
    const auto time = Clock::now() - begin;
    times->Add(time);
    if (closed_one) measured.close.Add(time);
  };
  auto due = Clock::now();
  for (int k = 0; k < options.keyframes; ++k) {
    const LoopedSession::Step step = session.Next(k);
    std::this_thread::sleep_until(due += options.pace);
    const auto begin = Clock::now();
    measured.clock.Add(Clock::now() - begin);
    for (const ImuSample& sample : step.before) {
      measure(&measured.add_imu, [&] { builder.AddImu(sample); });
    }
    measure(&measured.add_keyframe,
            [&] { builder.AddKeyframe(step.state, step.observations); });
    for (const ImuSample& sample : step.after) builder.AddImu(sample);
  }
  *statistics = stream.statistics();
  before_end();
  return measured;
}

absl::Status Report(const Options& options, Daemon state, bool with_spool) {
  // On the disk, as on a device.
  const TempFolder scratch(std::filesystem::temp_directory_path());
  Rig rig = HandheldRig("latency");
  ClientOptions client;
  client.rig = rig.id;
  client.target = "unix:" + scratch.File("state/selfcald.sock");
  if (with_spool) client.spool_dir = scratch.File("spool");
  std::unique_ptr<DaemonProcess> daemon;
  if (state != Daemon::kAbsent) {
    auto started = DaemonProcess::Start(options.daemon, scratch.File("state"));
    if (!started.ok()) return started.status();
    daemon = *std::move(started);
    const absl::Status created =
        DaemonView(daemon->target(), rig.id).CreateRig(rig);
    if (!created.ok()) return created;
  }
  std::thread stall;
  if (state == Daemon::kStalled) {
    stall = std::thread([&] {
      std::this_thread::sleep_for(std::chrono::seconds(1));
      kill(daemon->pid(), SIGSTOP);
    });
  }
  StreamStatistics statistics;
  const auto go_on = [&] {
    if (!stall.joinable()) return;
    stall.join();
    kill(daemon->pid(), SIGCONT);
  };
  Measured measured = Run(options, client, rig, go_on, &statistics);
  const char* name = state == Daemon::kAbsent    ? "absent"
                     : state == Daemon::kStalled ? "stalled"
                                                 : "busy";
  fmt::print("daemon {}{}: queued {}, stored {}, spooled {}, dropped {}\n",
             name,
             with_spool ? ", with a spool" : "",
             statistics.queued,
             statistics.stored,
             statistics.spooled,
             statistics.dropped);
  fmt::print("{}\n", measured.clock.Line("  the clock alone"));
  fmt::print("{}\n", measured.add_imu.Line("  AddImu"));
  fmt::print("{}\n", measured.add_keyframe.Line("  AddKeyframe"));
  fmt::print("{}\n", measured.close.Line("  closing a segment"));
  std::fflush(stdout);
  return absl::OkStatus();
}

}  // namespace
}  // namespace selfcal::client

int main(int argc, char** argv) {
  using selfcal::client::Daemon;
  CLI::App app("How long a SLAM process waits for the client");
  selfcal::client::Options options;
  int pace_us = 1000;
  app.add_option("--daemon", options.daemon, "selfcald")->required();
  app.add_option("--keyframes", options.keyframes, "For each state");
  app.add_option("--pace-us", pace_us, "Between keyframes");
  CLI11_PARSE(app, argc, argv);
  options.pace = std::chrono::microseconds(pace_us);
  fmt::print("{:<24}{:>9}{:>9}{:>9}{:>9}{:>10}   [us]\n",
             "",
             "calls",
             "median",
             "99 %",
             "99.9 %",
             "max");
  for (const bool with_spool : {false, true}) {
    for (const Daemon state :
         {Daemon::kAbsent, Daemon::kStalled, Daemon::kBusy}) {
      const absl::Status status =
          selfcal::client::Report(options, state, with_spool);
      if (!status.ok()) {
        std::cerr << status << "\n";
        return 1;
      }
    }
  }
}
