#include "server/daemon/state_lock.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include <string>

#include "test/support/temp_folder.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;

class StateLockTest : public ::testing::Test {
 protected:
  const TempFolder temp_folder_;
  const std::filesystem::path folder_ = temp_folder_.path();
};

TEST_F(StateLockTest, CreatesTheFolderForItsOwnerAlone) {
  const auto lock = StateLock::Take(folder_ / "a" / "b");
  ASSERT_TRUE(lock.ok()) << lock.status();
  struct stat status {};
  ASSERT_EQ(stat((folder_ / "a" / "b").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0700u);
}

TEST_F(StateLockTest, NoticesThatItsFolderIsNotInPlace) {
  const auto state = folder_ / "state";
  const auto lock = StateLock::Take(state);
  ASSERT_TRUE(lock.ok()) << lock.status();
  EXPECT_TRUE(lock->IsInPlace());
  std::filesystem::rename(state, folder_ / "away");
  EXPECT_FALSE(lock->IsInPlace());
  std::filesystem::copy(folder_ / "away", state);
  EXPECT_FALSE(lock->IsInPlace());
}

TEST_F(StateLockTest, SecondIsToldWhoHoldsIt) {
  const auto first = StateLock::Take(folder_);
  ASSERT_TRUE(first.ok()) << first.status();
  const auto second = StateLock::Take(folder_);
  EXPECT_EQ(second.status().code(), absl::StatusCode::kFailedPrecondition);
  const std::string message(second.status().message());
  EXPECT_THAT(message, HasSubstr(folder_.string()));
  EXPECT_THAT(message, HasSubstr(std::to_string(getpid())));
}

TEST_F(StateLockTest, IsFreeAgainOnceItIsGone) {
  for (int i = 0; i < 3; ++i) {
    const auto lock = StateLock::Take(folder_);
    EXPECT_TRUE(lock.ok()) << lock.status();
  }
}

TEST_F(StateLockTest, MovesWithItsOwner) {
  auto first = StateLock::Take(folder_);
  ASSERT_TRUE(first.ok());
  {
    const StateLock moved = std::move(*first);
    EXPECT_FALSE(StateLock::Take(folder_).ok());
  }
  EXPECT_TRUE(StateLock::Take(folder_).ok());
}

TEST_F(StateLockTest, FolderThatCannotBeIsUnavailable) {
  EXPECT_EQ(StateLock::Take("/proc/no/such").status().code(),
            absl::StatusCode::kUnavailable);
  EXPECT_EQ(StateLock::Take("/dev/null").status().code(),
            absl::StatusCode::kUnavailable);
}

}  // namespace
}  // namespace selfcal::server
