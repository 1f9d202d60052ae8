// The uplink as it runs.
#include "server/uplink/uplink.h"

#include <chrono>
#include <thread>

#include "test/server/uplink/uplink_fixture.h"

namespace selfcal::server {
namespace {

class UplinkTest : public UplinkFixture {
 protected:
  // The way to the hub that the uplink has; its owner is the uplink.
  FakeHub* Begin(const UplinkOptions& options = {}) {
    return Begin(options, std::make_unique<FakeHub>(&*hub_.api));
  }
  FakeHub* Begin(const UplinkOptions& options, std::unique_ptr<FakeHub> way) {
    FakeHub* const kept = way.get();
    uplink_ = std::make_unique<Uplink>(
        device_.store.get(), &*device_.api, std::move(way), options, "1.2.3");
    const absl::Status started = uplink_->Start();
    EXPECT_TRUE(started.ok()) << started;
    return kept;
  }

  std::unique_ptr<Uplink> uplink_;
};

TEST_F(UplinkTest, ReportsByItself) {
  CreateDeviceRig();
  Begin();
  for (int k = 0; k < 3; ++k) Put(k);
  EXPECT_TRUE(Eventually([&] { return SegmentsAtHub() == 3; }));
}

TEST_F(UplinkTest, GoesOnWhenTheHubIsBack) {
  CreateDeviceRig();
  FakeHub* const way = Begin();
  way->reachable = false;
  for (int k = 0; k < 3; ++k) Put(k);
  const int calls = way->calls;
  EXPECT_TRUE(Eventually([&] { return way->calls > calls; }));
  way->reachable = true;
  EXPECT_TRUE(Eventually([&] { return SegmentsAtHub() == 3; }));
}

TEST_F(UplinkTest, WhatChangedBeforeAStartIsReported) {
  CreateDeviceRig();
  Begin();
  EXPECT_TRUE(Eventually([&] { return hub_.store->GetRig("a").ok(); }));
  uplink_.reset();
  Put(0);
  Begin();
  EXPECT_TRUE(Eventually([&] { return SegmentsAtHub() == 1; }));
}

TEST_F(UplinkTest, StopsAtOnceWhileItIsLimited) {
  CreateDeviceRig();
  FakeHub* const way = Begin({.max_bytes_per_s = 1});
  EXPECT_TRUE(Eventually([&] { return hub_.store->GetRig("a").ok(); }));
  Put(0);
  // The outbox counts the attempts to report, with those of this test: the
  // second one of the uplink has to wait.
  Outbox* const outbox = device_.store->outbox();
  int own = 0;
  EXPECT_TRUE(Eventually(
      [&] {
        const auto report = outbox->Next(outbox->List()->front(), 1 << 20);
        ++own;
        return report.ok() && report->attempt - own == 2;
      },
      kLongWait,
      kDaemonInterval));
  const auto begun = std::chrono::steady_clock::now();
  uplink_->Stop();  // would wait for an hour
  EXPECT_LT(std::chrono::steady_clock::now() - begun, kLongWait);
  EXPECT_EQ(way->calls, 1);
  EXPECT_EQ(SegmentsAtHub(), 0u);
}

TEST_F(UplinkTest, LimitHoldsWhileTheHubIsAway) {
  CreateDeviceRig();
  auto away = std::make_unique<FakeHub>(&*hub_.api);
  away->reachable = false;
  FakeHub* const way = Begin({.max_bytes_per_s = 1}, std::move(away));
  EXPECT_TRUE(Eventually([&] { return way->calls > 0; }));
  // It would have tried again after half a second.
  std::this_thread::sleep_for(std::chrono::milliseconds(1500));
  EXPECT_EQ(way->calls, 1);
}

TEST_F(UplinkTest, WithoutAHubNothingIsNoted) {
  CreateDeviceRig();
  Begin();
  EXPECT_TRUE(Eventually([&] { return hub_.store->GetRig("a").ok(); }));
  uplink_.reset();
  ASSERT_TRUE(device_.store->outbox()->Close().ok());
  Put(0);
  EXPECT_TRUE(device_.store->outbox()->List()->empty());
}

}  // namespace
}  // namespace selfcal::server
