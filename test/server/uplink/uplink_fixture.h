// A device and a hub in one process: each has its store, its pipeline and its
// methods. The way between them is a Hub that a test can break.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "selfcal/v1/uplink.pb.h"
#include "server/api/api.h"
#include "server/domain/domain.h"
#include "server/pipeline/pipeline.h"
#include "server/store/outbox.h"
#include "server/uplink/hub.h"
#include "test/server/store/fake_information.h"
#include "test/server/store/sqlite/open_sqlite_store.h"
#include "test/server/test_segments.h"
#include "test/support/eventually.h"
#include "test/support/temp_folder.h"

namespace selfcal::server {

// A daemon without its transports.
struct Side {
  Side() {
    auto opened = OpenSqliteStore(folder.File("selfcal.db"));
    EXPECT_TRUE(opened.ok()) << opened.status();
    store = *std::move(opened);
    domain.emplace(store.get());
    Estimators estimators;
    estimators.score =
        [](const Rig& rig, const Calibration&, const MotionSegment& segment) {
          return FakeInformation(rig, static_cast<double>(segment.key.index));
        };
    pipeline = MakePipeline(&*domain, {}, estimators);
    EXPECT_TRUE(pipeline->Start().ok());
    feed.emplace(store.get(), nullptr);
    api.emplace(&*domain, pipeline.get(), &*feed);
  }
  ~Side() {
    api->Stop();
    pipeline->Stop();
  }

  TempFolder folder;
  std::unique_ptr<Store> store;
  std::optional<Domain> domain;
  std::unique_ptr<Pipeline> pipeline;
  std::optional<EventFeed> feed;
  std::optional<Api> api;
};

// Calls a unary method as this caller.
template <typename Request, typename Response>
absl::Status CallApi(const Api& api,
                     const Caller& caller,
                     const Request& request,
                     Response* response) {
  for (const Method& method : api.methods()) {
    if (method.descriptor->input_type() != Request::descriptor()) continue;
    Call call;
    call.caller = caller;
    return std::get<UnaryHandler>(method.handler)(call, request, response);
  }
  return absl::UnimplementedError("no such method");
}

class FakeHub final : public Hub {
 public:
  explicit FakeHub(const Api* api) : api_(api) {}

  absl::StatusOr<v1::ReportResponse> Report(
      const v1::ReportRequest& request) override {
    if (cancelled) return absl::CancelledError("stopped");
    ++calls;
    if (!reachable) return absl::UnavailableError("the network is down");
    v1::ReportResponse response;
    if (request.number() > last_taken) {
      response.set_begin_anew(true);
      return response;
    }
    absl::Status status = CallApi(*api_, caller, request, &response);
    if (!status.ok()) return status;
    if (answers_lost > 0) {
      --answers_lost;
      return absl::UnavailableError("the answer was lost");
    }
    return response;
  }
  void Cancel() override { cancelled = true; }

  // What a certificate with the role of a device says.
  Caller caller{"device", {{Role::kProduce, ""}}};
  std::atomic<bool> reachable = true;
  std::atomic<int> answers_lost = 0;
  std::atomic<int> calls = 0;
  // Later reports are answered as by a hub that they contradict.
  std::atomic<std::int64_t> last_taken =
      std::numeric_limits<std::int64_t>::max();
  std::atomic<bool> cancelled = false;

 private:
  const Api* const api_;
};

class UplinkFixture : public ::testing::Test {
 protected:
  Rig CreateDeviceRig(const std::string& id = "a") {
    const Rig rig = TestRig(id);
    EXPECT_TRUE(device_.domain->CreateRig(rig).ok());
    return rig;
  }

  void Put(std::int64_t index, const std::string& rig = "a") {
    static const std::vector<MotionSegment> kSegments =
        TestSegments(TestRig("any"), 1);
    MotionSegment segment = kSegments.front();
    segment.key = {"s", index};
    const auto put = device_.domain->PutSegment(rig, segment);
    ASSERT_TRUE(put.ok()) << put.status();
  }

  // As an operator at the hub.
  template <typename Request, typename Response>
  absl::Status CallHub(const Request& request, Response* response) {
    return CallApi(
        *hub_.api, {"operator", {{Role::kAdminister, ""}}}, request, response);
  }

  std::size_t SegmentsAtHub(const std::string& rig = "a") {
    const auto segments = hub_.store->ListSegments(rig, Page{1000, ""});
    return segments.ok() ? segments->items.size() : 0;
  }

  Side device_;
  Side hub_;
};

}  // namespace selfcal::server
