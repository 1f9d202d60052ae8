// A daemon that stands still (SIGSTOP) takes nothing and answers nothing, and
// its connection stays open: who streams to it can leave all the same.
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <future>
#include <memory>
#include <thread>

#include "client/selfcal/client.h"
#include "test/client/selfcal/drain.h"
#include "test/system/running_daemon.h"
#include "test/system/simulated_walk.h"

namespace selfcal::client {
namespace {

using std::chrono::seconds;

class StandingDaemon : public ::testing::Test {
 protected:
  std::unique_ptr<SegmentStream> Stream() const {
    ClientOptions options;
    options.target = folder_.target();
    options.rig = "walker";
    return std::make_unique<SegmentStream>(options, nullptr);
  }

  // Whether it is gone within half a minute.
  bool Leaves(std::unique_ptr<SegmentStream> stream) const {
    auto gone = std::async(std::launch::async, [&] { stream.reset(); });
    const bool left = gone.wait_for(seconds(30)) == std::future_status::ready;
    kill(daemon_->pid(), SIGCONT);
    return left;
  }

  const Device device_ = SimulateWalk("walker", 30, 22);
  const ScratchFolder folder_;
  const std::unique_ptr<DaemonProcess> daemon_ = folder_.StartDaemon();
};

TEST_F(StandingDaemon, AStreamInTheMiddleOfAMessageLeaves) {
  ASSERT_TRUE(
      DaemonView(folder_.target(), "walker").CreateRig(device_.rig).ok());
  auto stream = Stream();
  ASSERT_TRUE(stream->Send(device_.segments[0]));
  ASSERT_TRUE(DrainFully(stream.get()).ok());
  kill(daemon_->pid(), SIGSTOP);
  // More than what the connection holds.
  for (int i = 1; i < 30; ++i) stream->Send(device_.segments[i]);
  std::this_thread::sleep_for(seconds(1));
  EXPECT_TRUE(Leaves(std::move(stream)));
}

TEST_F(StandingDaemon, AStreamThatConnectsLeaves) {
  kill(daemon_->pid(), SIGSTOP);
  auto stream = Stream();
  ASSERT_TRUE(stream->Send(device_.segments[0]));
  std::this_thread::sleep_for(seconds(1));
  EXPECT_TRUE(Leaves(std::move(stream)));
}

}  // namespace
}  // namespace selfcal::client
