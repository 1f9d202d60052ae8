// A device and its hub as processes that are killed at any moment.
#include <signal.h>

#include <random>

#include "selfcal/v1/store_service.grpc.pb.h"
#include "test/promise.h"
#include "test/server/daemon/daemon_fixture.h"

namespace selfcal::server {
namespace {

class UplinkDaemonTest : public DaemonTest {
 protected:
  std::string HubAddress() const {
    return "unix:" + (folder_ / "hub.sock").string();
  }

  std::unique_ptr<Process> StartHub() {
    auto hub = std::make_unique<Process>(
        std::vector<std::string>{SELFCALD_PATH,
                                 "--state-dir",
                                 (folder_ / "hub").string(),
                                 "--listen",
                                 HubAddress()},
        folder_ / ("hub" + std::to_string(++hubs_)));
    EXPECT_TRUE(hub->Says("selfcald ready")) << hub->Log();
    return hub;
  }

  std::unique_ptr<Process> StartDevice() {
    return StartAndWait({"--uplink",
                         HubAddress(),
                         "--uplink-interval",
                         "1",
                         "--session-idle",
                         "0"});
  }

  // What a daemon has of the rig, through its contract, but for the data of
  // segments, which is not reported.
  std::vector<std::string> Records(
      const std::shared_ptr<grpc::Channel>& channel) {
    std::vector<std::string> records;
    const auto add = [&](const grpc::Status& status, const auto& message) {
      records.push_back(status.ok() ? message.ShortDebugString()
                                    : status.error_message());
    };
    {
      grpc::ClientContext context;
      v1::ListSegmentsRequest request;
      request.set_parent("rigs/r");
      request.set_page_size(1000);
      v1::ListSegmentsResponse response;
      const auto status = v1::SegmentService::NewStub(channel)->ListSegments(
          &context, request, &response);
      for (v1::Segment& segment : *response.mutable_segments()) {
        segment.clear_has_data();
        segment.clear_payload_bytes();
      }
      add(status, response);
    }
    {
      grpc::ClientContext context;
      v1::ListTablesRequest request;
      request.set_parent("rigs/r");
      v1::ListTablesResponse response;
      add(v1::SegmentService::NewStub(channel)->ListTables(
              &context, request, &response),
          response);
    }
    {
      grpc::ClientContext context;
      v1::ListCalibrationsRequest request;
      request.set_parent("rigs/r");
      request.set_page_size(1000);
      v1::ListCalibrationsResponse response;
      add(v1::CalibrationService::NewStub(channel)->ListCalibrations(
              &context, request, &response),
          response);
    }
    {
      grpc::ClientContext context;
      v1::ListEventsRequest request;
      request.set_parent("rigs/r");
      request.set_page_size(1000);
      v1::ListEventsResponse response;
      add(v1::StoreService::NewStub(channel)->ListEvents(
              &context, request, &response),
          response);
    }
    return records;
  }

  bool HubHasWhatTheDeviceHas() {
    return Eventually([&] { return Records(channel_) == RecordsOfHub(); },
                      kLongWait,
                      kDaemonInterval);
  }

  std::vector<std::string> RecordsOfHub() {
    return Records(
        grpc::CreateChannel(HubAddress(), grpc::InsecureChannelCredentials()));
  }

 private:
  int hubs_ = 0;
};

TEST_F(UplinkDaemonTest, HubHasWhatTheDeviceHasAfterKillsOfBoth) {
  Promise promise("the hub has what the device has, whoever is killed");
  std::mt19937 random(7);
  auto hub = StartHub();
  auto device = StartDevice();
  const Rig rig = CreateRig();
  std::vector<MotionSegment> segments = TestSegments(rig, 2);
  std::int64_t index = 0;
  for (int trial = 0; trial < Trials(6); ++trial) {
    for (MotionSegment& segment : segments) segment.key.index = index++;
    Stream(segments);
    const auto delay = std::chrono::milliseconds(
        std::uniform_int_distribution<int>(0, 1500)(random));
    std::this_thread::sleep_for(delay);
    if (trial % 2 == 0) {
      hub->Signal(SIGKILL);
      hub->Wait();
      hub = StartHub();
    } else {
      device->Signal(SIGKILL);
      device->Wait();
      device = StartDevice();
    }
    ++promise.trials;
  }
  ASSERT_TRUE(AllScored());
  const bool same = HubHasWhatTheDeviceHas();
  if (!same) {
    ++promise.lost;
    EXPECT_EQ(Records(channel_), RecordsOfHub()) << device->Log();
  }
  EXPECT_GE(Segments().segments_size(), 2 * promise.trials);
}

}  // namespace
}  // namespace selfcal::server
