// Sends what a simulated device records to a daemon, for the test of the pages.
//
//   send_segments ADDRESS RIG SESSION SECONDS
#include <chrono>
#include <cstdio>
#include <cstdlib>

#include "client/selfcal/client.h"
#include "test/browser/simulated_device.h"

namespace selfcal {
namespace {

constexpr std::uint64_t kSeed = 2;
constexpr std::chrono::seconds kPatience{60};

absl::Status Send(const std::string& address,
                  const std::string& rig,
                  const std::string& session,
                  double seconds) {
  client::ClientOptions options;
  options.target = address;
  options.rig = rig;
  options.max_queue = 1000;
  client::SegmentStream stream(options, nullptr);
  for (MotionSegment& segment :
       Record(MakeDevice(rig), *MakeHandheld(seconds, 1, kSeed), session)) {
    stream.Send(std::move(segment));
  }
  absl::Status sent = stream.Drain(kPatience);
  const auto statistics = stream.statistics();
  // One whose acknowledgement was lost is sent again.
  const auto acknowledged = statistics.stored + statistics.duplicates;
  if (sent.ok() && acknowledged != statistics.queued) {
    return absl::InternalError("not all segments were stored");
  }
  return sent;
}

}  // namespace
}  // namespace selfcal

int main(int argc, char** argv) {
  if (argc != 5) {
    std::fprintf(stderr, "usage: send_segments ADDRESS RIG SESSION SECONDS\n");
    return EXIT_FAILURE;
  }
  const absl::Status sent =
      selfcal::Send(argv[1], argv[2], argv[3], std::atof(argv[4]));
  if (sent.ok()) return EXIT_SUCCESS;
  std::fprintf(stderr, "%s\n", sent.ToString().c_str());
  return EXIT_FAILURE;
}
