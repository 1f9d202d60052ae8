#include "client/selfcal/spooled_segments.h"

#include <gtest/gtest.h>

#include <fstream>

#include "test/client/selfcal/test_segments.h"
#include "test/support/temp_folder.h"

namespace selfcal::client {
namespace {

class SpooledSegmentsTest : public ::testing::Test {
 protected:
  SpooledSegmentsTest() {
    options_.rig = "device";
    options_.spool_dir = folder_.path();
  }
  std::filesystem::path File(int number) const {
    std::string name = std::to_string(number);
    name.insert(0, 20 - name.size(), '0');
    return folder_.path() / "device" / (name + ".segment");
  }

  TempFolder folder_;
  ClientOptions options_;
};

TEST_F(SpooledSegmentsTest, HoldsNothingWithoutAFolder) {
  options_.spool_dir.clear();
  SpooledSegments spool = SpooledSegments::Open(options_);
  EXPECT_FALSE(spool.exists());
  EXPECT_FALSE(spool.report().has_unloaded);
  EXPECT_TRUE(spool.report().status.ok());
  EXPECT_EQ(spool.report().failures, 0u);
  EXPECT_EQ(spool.NextNumber(), 1u);
  EXPECT_EQ(spool.NextNumber(), 2u);
}

TEST_F(SpooledSegmentsTest, ReportsWhyItCannotBeUsed) {
  ClientOptions no_rig = options_;
  no_rig.rig = "no/rig";
  const SpooledSegments nameless = SpooledSegments::Open(no_rig);
  EXPECT_FALSE(nameless.exists());
  EXPECT_TRUE(absl::IsInvalidArgument(nameless.report().status));
  EXPECT_EQ(nameless.report().failures, 1u);

  const SpooledSegments holder = SpooledSegments::Open(options_);
  ASSERT_TRUE(holder.exists());
  const SpooledSegments second = SpooledSegments::Open(options_);
  EXPECT_FALSE(second.exists());
  EXPECT_TRUE(absl::IsAlreadyExists(second.report().status));
  EXPECT_EQ(second.report().failures, 1u);
}

TEST_F(SpooledSegmentsTest, ReturnsWhatWasWrittenOldestFirstAndOnce) {
  SpooledSegments spool = SpooledSegments::Open(options_);
  ASSERT_TRUE(spool.exists());
  for (const std::uint64_t number : {4u, 5u, 9u}) {
    EXPECT_TRUE(spool.Write(Encoded(number)));
  }
  EXPECT_EQ(spool.report().spooled, 3u);
  EXPECT_EQ(spool.report().segments, 3u);
  EXPECT_EQ(spool.report().recovered, 0u);
  for (const std::uint64_t number : {4u, 5u, 9u}) {
    ASSERT_TRUE(spool.report().has_unloaded);
    for (int reading = 0; reading < 2; ++reading) {  // until it is loaded
      const auto read = spool.ReadUnloaded();
      ASSERT_TRUE(read.has_value());
      EXPECT_EQ(read->number, number);
      EXPECT_EQ(read->key, KeyOf(*Encoded(number).request));
      EXPECT_TRUE(read->on_disk);
      EXPECT_EQ(read->request->SerializeAsString(),
                Encoded(number).request->SerializeAsString());
    }
    spool.MarkLoaded(number);
  }
  EXPECT_FALSE(spool.report().has_unloaded);
  EXPECT_EQ(spool.report().segments, 3u) << "until they are removed";
  spool.Remove({4, 9});
  EXPECT_EQ(spool.report().segments, 1u);
  EXPECT_FALSE(std::filesystem::exists(File(4)));
  EXPECT_TRUE(std::filesystem::exists(File(5)));
}

TEST_F(SpooledSegmentsTest, NumbersOnFromWhatAnEarlierProcessLeft) {
  {
    SpooledSegments spool = SpooledSegments::Open(options_);
    EXPECT_EQ(spool.NextNumber(), 1u);
    ASSERT_TRUE(spool.Write(Encoded(41)));
  }
  SpooledSegments spool = SpooledSegments::Open(options_);
  EXPECT_EQ(spool.report().recovered, 1u);
  EXPECT_EQ(spool.report().spooled, 0u);
  EXPECT_GT(spool.report().bytes, 0u);
  EXPECT_EQ(spool.NextNumber(), 42u);
  EXPECT_TRUE(spool.report().has_unloaded);
}

TEST_F(SpooledSegmentsTest, IsBlockedWhenItIsFullUntilLaterOrThereIsRoom) {
  const auto bytes = [&] {
    SpooledSegments measured = SpooledSegments::Open(options_);
    EXPECT_TRUE(measured.Write(Encoded(1)));
    return measured.report().bytes;
  }();
  options_.max_spool_bytes = bytes + bytes / 2;  // for the one that is there
  SpooledSegments spool = SpooledSegments::Open(options_);
  EXPECT_FALSE(spool.blocked());
  const auto before = SpooledSegments::Clock::now();
  EXPECT_FALSE(spool.Write(Encoded(2)));
  EXPECT_TRUE(spool.blocked());
  EXPECT_TRUE(absl::IsResourceExhausted(spool.report().status));
  EXPECT_EQ(spool.report().failures, 0u) << "a full spool is no failure";
  ASSERT_TRUE(spool.retry_at().has_value());
  const auto end = *spool.retry_at();
  EXPECT_GE(end, before + SpooledSegments::kSpoolRetry);

  spool.RetryIfDue(end - std::chrono::nanoseconds(1));
  EXPECT_TRUE(spool.blocked());
  spool.RetryIfDue(end);
  EXPECT_FALSE(spool.blocked());

  EXPECT_FALSE(spool.Write(Encoded(2)));
  EXPECT_TRUE(spool.blocked());
  spool.Remove({1});
  EXPECT_FALSE(spool.blocked());
  EXPECT_TRUE(spool.Write(Encoded(2)));
  EXPECT_TRUE(spool.report().status.ok());
}

TEST_F(SpooledSegmentsTest, QuarantinesWhatIsDamagedOrOfAnotherRig) {
  SpooledSegments spool = SpooledSegments::Open(options_);
  auto foreign = std::make_shared<v1::StreamSegmentsRequest>();
  foreign->set_parent("rigs/other");
  ASSERT_TRUE(spool.Write(Encoded(1)));
  ASSERT_TRUE(spool.Write({2, {"walk", 2}, foreign, false}));
  ASSERT_TRUE(spool.Write(Encoded(3)));
  std::filesystem::resize_file(File(1), 10);
  for (std::uint64_t damaged = 1; damaged <= 2; ++damaged) {
    ASSERT_TRUE(spool.report().has_unloaded);
    EXPECT_FALSE(spool.ReadUnloaded().has_value());
    EXPECT_EQ(spool.report().damaged, damaged);
    EXPECT_TRUE(absl::IsDataLoss(spool.report().status));
    EXPECT_FALSE(spool.blocked()) << "the next may be intact";
  }
  EXPECT_EQ(spool.ReadUnloaded()->number, 3u);
  EXPECT_EQ(spool.report().segments, 1u);
  EXPECT_EQ(spool.report().failures, 0u);
}

TEST_F(SpooledSegmentsTest, IsBlockedWhenTheDiskFails) {
  SpooledSegments spool = SpooledSegments::Open(options_);
  ASSERT_TRUE(spool.Write(Encoded(1)));
  std::filesystem::rename(File(1), File(1).string() + ".gone");
  EXPECT_FALSE(spool.ReadUnloaded().has_value());
  EXPECT_TRUE(spool.blocked());
  EXPECT_EQ(spool.report().failures, 1u);
  EXPECT_TRUE(absl::IsUnavailable(spool.report().status));
  std::filesystem::rename(File(1).string() + ".gone", File(1));
  EXPECT_EQ(spool.ReadUnloaded()->number, 1u);
}

}  // namespace
}  // namespace selfcal::client
