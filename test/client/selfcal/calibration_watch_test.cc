#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <mutex>
#include <stdexcept>
#include <thread>
#include <vector>

#include "client/selfcal/calibration_version.h"
#include "client/selfcal/client.h"
#include "proto/convert.h"
#include "test/client/selfcal/fake_daemon.h"
#include "test/support/eventually.h"

namespace selfcal::client {
namespace {

// One camera whose focal length tells the version.
v1::Calibration Version(std::int64_t version) {
  Calibration theta;
  theta.cameras.resize(1);
  CameraCalibration& camera = theta.cameras[0];
  camera.f = {300.0 + static_cast<double>(version), 300};
  camera.c = {320, 240};
  camera.distortion << 0.9;
  camera.width_px = 640;
  camera.height_px = 480;
  v1::Calibration message;
  message.set_version(version);
  *message.mutable_parameters() = ToProto(theta);
  for (int i = 0; i < 27 * 28 / 2; ++i) message.add_covariance(i);
  return message;
}

// What a watch has told.
class Told {
 public:
  CalibrationWatch::Callback Callback() {
    return [this](const CalibrationVersion& version) {
      std::lock_guard lock(mutex_);
      told_.push_back(version);
    };
  }
  bool WaitFor(std::size_t count) const {
    return Eventually([&] { return versions().size() >= count; });
  }
  std::vector<std::int64_t> versions() const {
    std::lock_guard lock(mutex_);
    std::vector<std::int64_t> versions;
    for (const auto& version : told_) versions.push_back(version.version);
    return versions;
  }
  CalibrationVersion last() const {
    std::lock_guard lock(mutex_);
    return told_.back();
  }

 private:
  mutable std::mutex mutex_;
  std::vector<CalibrationVersion> told_;
};

class CalibrationWatchTest : public ::testing::Test {
 protected:
  ClientOptions Options() const {
    ClientOptions options;
    options.target = daemon_.target();
    options.rig = "device";
    options.min_backoff = std::chrono::milliseconds(1);
    options.max_backoff = std::chrono::milliseconds(20);
    return options;
  }

  FakeDaemon daemon_;
  Told told_;
};

TEST_F(CalibrationWatchTest, TellsTheActiveOneAtOnceAndThenEachNewOne) {
  daemon_.Publish(Version(1));
  daemon_.Start();
  CalibrationWatch watch(Options(), told_.Callback());
  ASSERT_TRUE(told_.WaitFor(1));
  daemon_.Publish(Version(2));
  ASSERT_TRUE(told_.WaitFor(2));
  EXPECT_THAT(told_.versions(), testing::ElementsAre(1, 2));
  EXPECT_EQ(told_.last().theta.cameras[0].f.x(), 302);
  EXPECT_TRUE(watch.connection_status().ok());
}

TEST_F(CalibrationWatchTest, TellsARollBackAndNoneTwiceInARow) {
  daemon_.Publish(Version(3));
  daemon_.Start();
  CalibrationWatch watch(Options(), told_.Callback());
  ASSERT_TRUE(told_.WaitFor(1));
  daemon_.Publish(Version(2));
  ASSERT_TRUE(told_.WaitFor(2));
  daemon_.Publish(Version(2));
  daemon_.Publish(Version(3));
  ASSERT_TRUE(told_.WaitFor(3));
  EXPECT_THAT(told_.versions(), testing::ElementsAre(3, 2, 3));
}

TEST_F(CalibrationWatchTest, TellsTheActiveOneAgainWhenItsVerdictChanges) {
  v1::Calibration version = Version(3);
  version.mutable_verdict()->set_kind(v1::Verdict::GOOD);
  daemon_.Publish(version);
  daemon_.Start();
  CalibrationWatch watch(Options(), told_.Callback());
  ASSERT_TRUE(told_.WaitFor(1));
  EXPECT_EQ(told_.last().verdict, CalibrationVersion::Verdict::kGood);
  EXPECT_THAT(told_.last().reasons, testing::IsEmpty());
  version.mutable_verdict()->set_kind(v1::Verdict::NOT_TRUSTWORTHY);
  version.mutable_verdict()->add_sentences("The device has changed since.");
  daemon_.Publish(version);
  ASSERT_TRUE(told_.WaitFor(2));
  EXPECT_THAT(told_.versions(), testing::ElementsAre(3, 3));
  EXPECT_EQ(told_.last().verdict, CalibrationVersion::Verdict::kNotTrustworthy);
  EXPECT_THAT(told_.last().reasons,
              testing::ElementsAre("The device has changed since."));
}

TEST_F(CalibrationWatchTest, TellsNoVersionTwiceOverRestarts) {
  daemon_.Publish(Version(1));
  CalibrationWatch watch(Options(), told_.Callback());
  for (std::int64_t version = 1; version < 6; ++version) {
    daemon_.Start();
    ASSERT_TRUE(told_.WaitFor(static_cast<std::size_t>(version)));
    daemon_.Stop();
    // Half of the time the same one is sent again by the next daemon.
    daemon_.Start();
    if (version % 2 == 0) {
      ASSERT_TRUE(Eventually([&] { return watch.connection_status().ok(); }));
    }
    daemon_.Publish(Version(version + 1));
    ASSERT_TRUE(told_.WaitFor(static_cast<std::size_t>(version) + 1));
    daemon_.Stop();
  }
  EXPECT_THAT(told_.versions(), testing::ElementsAre(1, 2, 3, 4, 5, 6));
}

TEST_F(CalibrationWatchTest, WaitsForARigThatDoesNotExistYet) {
  daemon_.FailStreamsWith({grpc::StatusCode::NOT_FOUND, "no such rig"});
  daemon_.Start();
  CalibrationWatch watch(Options(), told_.Callback());
  ASSERT_TRUE(Eventually([&] { return !watch.connection_status().ok(); }));
  EXPECT_TRUE(absl::IsNotFound(watch.connection_status()));
  daemon_.Publish(Version(1));
  daemon_.FailStreamsWith(grpc::Status::OK);
  ASSERT_TRUE(told_.WaitFor(1));
}

TEST_F(CalibrationWatchTest, LeavesOutACalibrationThatCannotBeUsed) {
  v1::Calibration broken = Version(1);
  broken.mutable_parameters()->mutable_cameras(0)->mutable_q_ci()->set_w(2);
  daemon_.Publish(broken);
  daemon_.Start();
  CalibrationWatch watch(Options(), told_.Callback());
  ASSERT_TRUE(daemon_.WaitForWatcher(1));
  ASSERT_TRUE(Eventually([&] { return !watch.connection_status().ok(); }));
  EXPECT_EQ(watch.connection_status().code(), absl::StatusCode::kDataLoss);
  daemon_.Publish(Version(2));
  ASSERT_TRUE(told_.WaitFor(1));
  EXPECT_THAT(told_.versions(), testing::ElementsAre(2));
}

TEST_F(CalibrationWatchTest, CountsCallbacksThatThrow) {
  daemon_.Publish(Version(1));
  daemon_.Start();
  CalibrationWatch watch(Options(), [](const CalibrationVersion&) {
    throw std::runtime_error("a bug");
  });
  ASSERT_TRUE(Eventually([&] { return watch.callback_failures() == 1; }));
  daemon_.Publish(Version(2));
  EXPECT_TRUE(Eventually([&] { return watch.callback_failures() == 2; }));
}

TEST_F(CalibrationWatchTest, CanBeDestroyedInAnyState) {
  for (int trial = 0; trial < 20; ++trial) {
    CalibrationWatch watch(Options(), told_.Callback());
    if (trial % 2 == 0) {
      ASSERT_TRUE(Eventually([&] { return !watch.connection_status().ok(); }));
    }
  }
  daemon_.Publish(Version(1));
  daemon_.Start();
  for (std::size_t trial = 1; trial <= 20; ++trial) {
    Told told;
    CalibrationWatch watch(Options(), told.Callback());
    ASSERT_TRUE(trial % 2 == 0 || told.WaitFor(1));
  }
}

TEST(CalibrationVersion, UnpacksTheCovariance) {
  const auto version = ToCalibrationVersion(Version(3));
  ASSERT_TRUE(version.ok());
  EXPECT_EQ(version->version, 3);
  ASSERT_EQ(version->covariance.rows(), 27);
  EXPECT_EQ(version->covariance, version->covariance.transpose());
  EXPECT_EQ(version->covariance(0, 0), 0);
  EXPECT_EQ(version->covariance(1, 0), 1);
  EXPECT_EQ(version->covariance(1, 1), 2);
  EXPECT_EQ(version->covariance(26, 26), 27 * 28 / 2 - 1);
}

TEST(CalibrationVersion, NamesWhatIsWrong) {
  v1::Calibration short_covariance = Version(1);
  short_covariance.mutable_covariance()->RemoveLast();
  const auto version = ToCalibrationVersion(short_covariance);
  EXPECT_EQ(version.status().code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(version.status().message()),
              testing::HasSubstr("covariance"));

  v1::Calibration no_focal = Version(1);
  no_focal.mutable_parameters()->mutable_cameras(0)->clear_f();
  const auto other = ToCalibrationVersion(no_focal);
  EXPECT_THAT(std::string(other.status().message()),
              testing::HasSubstr("parameters.cameras[0].f"));
}

}  // namespace
}  // namespace selfcal::client
