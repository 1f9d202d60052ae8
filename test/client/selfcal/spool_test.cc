#include "client/selfcal/spool.h"

#include <gtest/gtest.h>

#include <fstream>
#include <random>
#include <string>

#include "client/selfcal/spool_file.h"
#include "test/support/files.h"
#include "test/support/temp_folder.h"

namespace selfcal::client {
namespace {

constexpr std::uint64_t kPlenty = 1 << 20;

class SpoolTest : public ::testing::Test {
 protected:
  std::unique_ptr<Spool> Open(std::uint64_t max_bytes = kPlenty) {
    auto spool = Spool::Open(folder_.path() / "rig", max_bytes);
    EXPECT_TRUE(spool.ok()) << spool.status();
    return *std::move(spool);
  }
  std::filesystem::path File(int number) const {
    std::string name = std::to_string(number);
    name.insert(0, 20 - name.size(), '0');
    return folder_.path() / "rig" / (name + ".segment");
  }

  TempFolder folder_;
};

TEST_F(SpoolTest, GivesBackWhatWasWrittenInItsOrderAlsoToTheNextProcess) {
  for (int process = 0; process < 2; ++process) {
    const auto spool = Open();
    if (process == 0) {
      EXPECT_EQ(spool->next_number(), 1u);
      for (const std::uint64_t number : {7u, 3u, 11u}) {
        ASSERT_TRUE(spool->Write(number, std::string(number, 'x')).ok());
      }
    }
    EXPECT_EQ(spool->size(), 3u);
    EXPECT_EQ(spool->next_number(), 12u);
    std::uint64_t from = 0;
    for (const std::uint64_t number : {3u, 7u, 11u}) {
      ASSERT_EQ(spool->FirstFrom(from), number);
      const auto payload = spool->Read(number);
      ASSERT_TRUE(payload.ok());
      EXPECT_EQ(*payload, std::string(number, 'x'));
      from = number + 1;
    }
    EXPECT_EQ(spool->FirstFrom(from), std::nullopt);
  }
}

TEST_F(SpoolTest, NoticesEveryDamage) {
  const auto spool = Open();
  std::mt19937 random(1);
  std::string payload(30, '\0');
  for (char& c : payload) c = static_cast<char>(random());
  ASSERT_TRUE(WriteSpoolFile(File(1), payload).ok());
  const std::string bytes = ReadBytes(File(1));
  ASSERT_EQ(bytes.size(), payload.size() + kSpoolHeaderBytes);
  const auto expect_loss = [&](const std::string& damaged) {
    WriteBytes(File(1), damaged);
    EXPECT_EQ(ReadSpoolFile(File(1)).status().code(),
              absl::StatusCode::kDataLoss);
  };
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    std::string flipped = bytes;
    flipped[bit / 8] = static_cast<char>(flipped[bit / 8] ^ (1 << bit % 8));
    expect_loss(flipped);
  }
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    expect_loss(bytes.substr(0, size));
  }
  expect_loss(bytes + "x");
  WriteBytes(File(1), bytes);
  EXPECT_EQ(*ReadSpoolFile(File(1)), payload);
}

TEST_F(SpoolTest, KeepsToItsBytes) {
  const std::uint64_t one = 100 + kSpoolHeaderBytes;
  const auto spool = Open(3 * one);
  const std::string payload(100, 'x');
  for (const std::uint64_t number : {1u, 2u, 3u}) {
    EXPECT_TRUE(spool->Write(number, payload).ok());
  }
  const absl::Status full = spool->Write(4, payload);
  EXPECT_TRUE(absl::IsResourceExhausted(full)) << full;
  EXPECT_EQ(spool->size(), 3u);
  EXPECT_EQ(spool->bytes(), 3 * one);
  spool->Remove(1);
  EXPECT_FALSE(std::filesystem::exists(File(1)));
  EXPECT_TRUE(spool->Write(4, payload).ok());
  // What is set aside makes room.
  spool->Quarantine(2);
  EXPECT_EQ(spool->bytes(), 3 * one);
  EXPECT_EQ(spool->size(), 2u);
  EXPECT_TRUE(spool->Write(5, payload).ok());
  EXPECT_FALSE(absl::IsResourceExhausted(spool->Read(5).status()));
  EXPECT_TRUE(absl::IsResourceExhausted(spool->Write(6, payload)));
}

TEST_F(SpoolTest, IsUsedByOneAtATime) {
  auto spool = Open();
  const auto second = Spool::Open(folder_.path() / "rig", kPlenty);
  EXPECT_EQ(second.status().code(), absl::StatusCode::kAlreadyExists);
  spool = nullptr;
  Open();
}

TEST_F(SpoolTest, ForgetsWhatWasNotFinished) {
  std::filesystem::create_directories(folder_.path() / "rig");
  const std::string unfinished = File(5).string() + ".tmp";
  std::ofstream(unfinished) << "half";
  std::ofstream(folder_.path() / "rig" / "notes.txt") << "not ours";
  const auto spool = Open();
  EXPECT_EQ(spool->size(), 0u);
  EXPECT_FALSE(std::filesystem::exists(unfinished));
  EXPECT_TRUE(std::filesystem::exists(folder_.path() / "rig" / "notes.txt"));
}

TEST_F(SpoolTest, SaysWhyAFolderCannotBeUsed) {
  std::ofstream(folder_.path() / "file") << "";
  const auto spool = Spool::Open(folder_.path() / "file" / "rig", kPlenty);
  EXPECT_EQ(spool.status().code(), absl::StatusCode::kUnavailable);
}

}  // namespace
}  // namespace selfcal::client
