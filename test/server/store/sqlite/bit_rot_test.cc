// Bytes flip anywhere in the file: what is read is what was written, or is
// refused; never a crash.
#include <algorithm>
#include <random>

#include "server/store/maintenance.h"
#include "test/promise.h"
#include "test/server/store/fixture_content.h"
#include "test/server/store/sqlite/sqlite_test.h"
#include "test/support/files.h"

namespace selfcal::server {
namespace {

class BitRotTest : public SqliteTest {
 protected:
  // Everything that has a checksum, as far as it can be read.
  struct Contents {
    std::vector<std::string> data;  // of segments
    std::vector<double> focal_lengths;
    std::vector<double> entropies;
  };

  Contents ReadAll() {
    Contents contents;
    for (int k = 0; k < 4; ++k) {
      const auto data = store_->GetSegmentData("a", {"s", k});
      contents.data.push_back(
          data.ok() ? std::to_string(data->observations.size()) + " " +
                          std::to_string(data->observations.back().z_px.x()) +
                          " " + std::to_string(data->imu.back().accel.x())
                    : "refused");
      const auto segment = store_->GetSegment("a", {"s", k});
      contents.entropies.push_back(segment.ok() && segment->information
                                       ? segment->information->groups[0].entropy
                                       : kRefused);
    }
    for (int version = 1; version <= 2; ++version) {
      const auto calibration = store_->GetCalibration("a", version);
      contents.focal_lengths.push_back(
          calibration.ok() ? calibration->theta.cameras[0].f.x() : kRefused);
    }
    return contents;
  }

  template <typename T>
  static bool SameOrRefused(const std::vector<T>& found,
                            const std::vector<T>& written,
                            const T& refused) {
    return std::equal(
        found.begin(),
        found.end(),
        written.begin(),
        written.end(),
        [&](const T& a, const T& b) { return a == b || a == refused; });
  }

  static constexpr double kRefused = -1e300;
};

TEST_F(BitRotTest, WhatIsReadIsWhatWasWrittenOrIsRefused) {
  Promise promise("bit rot is noticed");
  ASSERT_TRUE(Open().ok());
  ASSERT_TRUE(WriteFixture(store_.get()));
  const Contents written = ReadAll();
  store_.reset();
  const std::string whole = ReadBytes(Path());
  std::mt19937 random(5);
  // The zeros are mostly room that nothing uses.
  std::vector<std::size_t> used;
  for (std::size_t k = 0; k < whole.size(); ++k) {
    if (whole[k] != 0) used.push_back(k);
  }
  std::uniform_int_distribution<std::size_t> place(0, used.size() - 1);
  std::uniform_int_distribution<int> flips(1, 6);
  std::uniform_int_distribution<int> mask(1, 255);
  int refused_at_once = 0;
  int noticed = 0;
  const int trials = Trials(200);
  for (int trial = 0; trial < trials; ++trial) {
    SCOPED_TRACE(trial);
    std::string bytes = whole;
    for (int k = flips(random); k > 0; --k) {
      bytes[used[place(random)]] ^= static_cast<char>(mask(random));
    }
    for (const char* suffix : {"-wal", "-shm"}) {
      std::filesystem::remove(Path() + suffix);
    }
    WriteBytes(Path(), bytes);
    ++promise.trials;
    if (!Open().ok()) {
      ++refused_at_once;
      continue;
    }
    const auto summary =
        store_->maintenance()->Check([](const auto&) { return true; });
    const bool doctor = !summary.ok() || summary->problems > 0;
    noticed += doctor ? 1 : 0;
    const Contents found = ReadAll();
    // Data of another segment may be found missing, never other data.
    if (!SameOrRefused(found.data, written.data, std::string("refused")) ||
        !SameOrRefused(found.focal_lengths, written.focal_lengths, kRefused) ||
        !SameOrRefused(found.entropies, written.entropies, kRefused)) {
      ++promise.lost;
    }
    const bool all_there = found.data == written.data &&
                           found.focal_lengths == written.focal_lengths &&
                           found.entropies == written.entropies;
    EXPECT_TRUE(all_there || doctor) << "lost, and the doctor sees nothing";
    store_.reset();
  }
  std::printf("refused at once %d, noticed by the check %d of %d\n",
              refused_at_once,
              noticed,
              trials);
  const int opened = trials - refused_at_once;
  EXPECT_GT(opened, trials / 4);
  EXPECT_GT(noticed, opened / 2);
}

// The row has its checksum, but is found in the wrong place.
TEST_F(BitRotTest, DataOfAnotherSegmentIsRefused) {
  ASSERT_TRUE(Open().ok());
  ASSERT_TRUE(WriteFixture(store_.get()));
  ASSERT_TRUE(store_->GetSegmentData("a", {"s", 1}).ok());
  store_.reset();
  ASSERT_TRUE(ExecuteInFile(Path(),
                            "UPDATE payloads SET (data, raw_bytes, sha256) = "
                            "(SELECT data, raw_bytes, sha256 FROM payloads "
                            " WHERE sequence = 1) WHERE sequence = 2")
                  .ok());
  ASSERT_TRUE(Open().ok());
  EXPECT_TRUE(store_->GetSegmentData("a", {"s", 0}).ok());
  const auto other = store_->GetSegmentData("a", {"s", 1}).status();
  EXPECT_TRUE(absl::IsDataLoss(other)) << other;
}

TEST_F(BitRotTest, InformationOfAnotherSegmentIsRefused) {
  ASSERT_TRUE(Open().ok());
  ASSERT_TRUE(WriteFixture(store_.get()));
  ASSERT_TRUE(store_->GetSegment("a", {"s", 1}).ok());
  store_.reset();
  ASSERT_TRUE(ExecuteInFile(Path(),
                            "UPDATE segment_information SET "
                            "(information, sha256) = "
                            "(SELECT information, sha256 "
                            " FROM segment_information WHERE sequence = 1) "
                            "WHERE sequence = 2")
                  .ok());
  ASSERT_TRUE(Open().ok());
  EXPECT_TRUE(store_->GetSegment("a", {"s", 0}).ok());
  const auto other = store_->GetSegment("a", {"s", 1}).status();
  EXPECT_TRUE(absl::IsDataLoss(other)) << other;
  const auto listed = store_->ListSegments("a", Page{50, ""});
  ASSERT_TRUE(listed.ok()) << listed.status();
  for (const StoredSegment& segment : listed->items) {
    const bool refused = segment.key == SegmentKey{"s", 1};
    EXPECT_EQ(segment.problem.find("it is that of") != std::string::npos,
              refused)
        << segment.key.index << ": " << segment.problem;
  }
}

// A flip inside a payload's bytes, page by page.
TEST_F(BitRotTest, AFlipInTheDataOfASegmentIsFoundByTheDoctor) {
  ASSERT_TRUE(Open().ok());
  ASSERT_TRUE(WriteFixture(store_.get()));
  store_.reset();
  const std::string whole = ReadBytes(Path());
  const std::string data =
      ReadTextInFile(Path(), "SELECT data FROM payloads").value_or("");
  ASSERT_GT(data.size(), 3000u);
  const std::string piece = data.substr(data.size() / 2, 64);
  const std::size_t at = whole.find(piece);
  ASSERT_NE(at, std::string::npos);
  std::string bytes = whole;
  bytes[at] ^= 1;
  WriteBytes(Path(), bytes);
  ASSERT_TRUE(Open().ok());
  std::vector<std::string> places;
  const auto summary =
      store_->maintenance()->Check([&](const StoreProblem& problem) {
        places.push_back(problem.place);
        return true;
      });
  ASSERT_TRUE(summary.ok()) << summary.status();
  EXPECT_EQ(summary->problems, 2);  // the checksum, and the decoding
  EXPECT_THAT(
      places,
      ::testing::Contains(::testing::HasSubstr("the data of the segment")));
}

}  // namespace
}  // namespace selfcal::server
