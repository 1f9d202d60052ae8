// Fills a state folder for the test of the pages: a simulated device with its
// segments, runs and versions, one that has yet to send some, and many rigs
// that send nothing.
//
//   fill_state FOLDER
#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <thread>

#include "server/domain/domain.h"
#include "server/pipeline/pipeline.h"
#include "server/status/status_macros.h"
#include "test/browser/simulated_device.h"
#include "test/server/store/sqlite/open_sqlite_store.h"
#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

constexpr int kIdleRigs = 70;
constexpr double kSeconds = 60;
constexpr std::uint64_t kSeed = 1;

absl::StatusOr<bool> IsSettled(Store* store) {
  SELFCAL_ASSIGN_OR_RETURN(const auto unscored, store->ListUnscored(1));
  SELFCAL_ASSIGN_OR_RETURN(const auto runs, store->ListUnfinishedRuns());
  return unscored.empty() && runs.empty();
}

// Waits until all is scored and no run is unfinished.
absl::Status Settle(Store* store) {
  absl::StatusOr<bool> settled = false;
  const bool in_time = Eventually(
      [&] {
        settled = IsSettled(store);
        return !settled.ok() || *settled;
      },
      10 * kLongWait,
      std::chrono::milliseconds(20));
  if (!in_time) return absl::DeadlineExceededError("a run does not end");
  return settled.status();
}

// Scored and calibrated on as the daemon does it.
absl::Status AddDevice(Domain* domain, const std::string& id) {
  const SimulatedDevice device = MakeDevice(id);
  SELFCAL_RETURN_IF_ERROR(domain->CreateRig(device.rig).status());
  PipelineOptions pipeline_options;
  pipeline_options.program_version = "test";
  const auto pipeline = MakePipeline(domain, pipeline_options);
  SELFCAL_RETURN_IF_ERROR(pipeline->Start());
  for (const MotionSegment& segment :
       Record(device, *MakeMixed(kSeconds, kSeed), "walk")) {
    SELFCAL_RETURN_IF_ERROR(
        pipeline->Submit(id, segment, [] { return false; }).status());
  }
  SELFCAL_RETURN_IF_ERROR(Settle(domain->store()));
  SELFCAL_RETURN_IF_ERROR(pipeline->StartRecalibration(id, true).status());
  SELFCAL_RETURN_IF_ERROR(Settle(domain->store()));
  pipeline->Stop();
  return absl::OkStatus();
}

// A device with a second IMU and one segment.
absl::Status AddDeviceOfTwoImus(Domain* domain, const std::string& id) {
  const SimulatedDevice device = MakeDevice(id, /*has_second_imu=*/true);
  SELFCAL_RETURN_IF_ERROR(domain->CreateRig(device.rig).status());
  const auto segments = Record(device, *MakeHandheld(3, 1, kSeed), "walk");
  return domain->PutSegment(id, segments.front()).status();
}

absl::Status Fill(const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  SELFCAL_ASSIGN_OR_RETURN(const auto store,
                           OpenSqliteStore(folder / "selfcal.db"));
  Domain domain(store.get());
  for (int i = 1; i <= kIdleRigs; ++i) {
    SELFCAL_RETURN_IF_ERROR(
        domain.CreateRig(HandheldRig(fmt::format("phone-{:03}", i))).status());
  }
  SELFCAL_RETURN_IF_ERROR(domain.CreateRig(MakeDevice("headset").rig).status());
  SELFCAL_RETURN_IF_ERROR(AddDeviceOfTwoImus(&domain, "pair"));
  return AddDevice(&domain, "tablet");
}

}  // namespace
}  // namespace selfcal::server

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: fill_state FOLDER\n");
    return EXIT_FAILURE;
  }
  const absl::Status filled = selfcal::server::Fill(argv[1]);
  if (filled.ok()) return EXIT_SUCCESS;
  std::fprintf(stderr, "%s\n", filled.ToString().c_str());
  return EXIT_FAILURE;
}
