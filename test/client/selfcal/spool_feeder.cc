// Feeds a stream that reaches no daemon, and prints after each segment how many
// are in its spool: segment 0 stays in memory, so that n means 1 to n. For
// segment_spool_test, which kills it.
#include <cstdio>
#include <thread>

#include "client/selfcal/client.h"
#include "test/support/eventually.h"

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  selfcal::client::ClientOptions options;
  options.target = argv[1];
  options.spool_dir = argv[2];
  options.rig = "device";
  options.max_queue = 2;
  selfcal::client::SegmentStream stream(options, nullptr);
  for (std::int64_t i = 0;; ++i) {
    selfcal::MotionSegment segment;
    segment.key = {"walk", i};
    segment.keyframes.resize(3);
    segment.imu.resize(100);
    if (!selfcal::Eventually([&] { return stream.Send(segment); })) return 1;
    const auto spooled = stream.statistics().spooled;
    if (spooled == 0) continue;
    std::printf("%llu\n", static_cast<unsigned long long>(spooled));
    std::fflush(stdout);
  }
}
