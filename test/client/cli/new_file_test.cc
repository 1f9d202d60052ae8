#include "client/cli/new_file.h"

#include <gtest/gtest.h>
#include <stdlib.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "test/support/files.h"
#include "test/support/temp_folder.h"

namespace selfcal::client {
namespace {

namespace fs = std::filesystem;

class NewFileTest : public ::testing::Test {
 protected:
  std::string Content() const { return ReadBytes(path_); }
  int Files() const {
    return static_cast<int>(std::distance(fs::directory_iterator(folder_), {}));
  }

  const TempFolder temp_folder_;
  const fs::path folder_ = temp_folder_.path();
  const fs::path path_ = folder_ / "file";
};

TEST_F(NewFileTest, HasItsNameOnceItIsWhole) {
  NewFile file;
  ASSERT_TRUE(file.Open(path_, false).ok());
  ASSERT_TRUE(file.Append("one ").ok());
  ASSERT_TRUE(file.Append("two").ok());
  EXPECT_FALSE(fs::exists(path_));
  ASSERT_TRUE(file.Commit().ok());
  EXPECT_EQ(Content(), "one two");
  EXPECT_EQ(Files(), 1);
  // What the daemon keeps is its owner's alone; so is a copy.
  EXPECT_EQ(fs::status(path_).permissions(),
            fs::perms::owner_read | fs::perms::owner_write);
}

TEST_F(NewFileTest, LeavesNothingUnlessItIsCommitted) {
  {
    NewFile file;
    ASSERT_TRUE(file.Open(path_, false).ok());
    ASSERT_TRUE(file.Append("half").ok());
    EXPECT_EQ(Files(), 1);
  }
  EXPECT_EQ(Files(), 0);
}

TEST_F(NewFileTest, OverwritesOnlyIfItIsAsked) {
  std::ofstream(path_) << "precious";
  NewFile refused;
  EXPECT_TRUE(absl::IsAlreadyExists(refused.Open(path_, false)));
  NewFile file;
  ASSERT_TRUE(file.Open(path_, true).ok());
  ASSERT_TRUE(file.Append("new").ok());
  EXPECT_EQ(Content(), "precious");
  ASSERT_TRUE(file.Commit().ok());
  EXPECT_EQ(Content(), "new");
  EXPECT_EQ(Files(), 1);
}

TEST_F(NewFileTest, LeavesAFileThatCameInTheMeantime) {
  NewFile file;
  ASSERT_TRUE(file.Open(path_, false).ok());
  std::ofstream(path_) << "precious";
  EXPECT_TRUE(absl::IsAlreadyExists(file.Commit()));
  EXPECT_EQ(Content(), "precious");
}

TEST_F(NewFileTest, NeverReplacesWhatIsNoFile) {
  NewFile folder;
  EXPECT_TRUE(absl::IsFailedPrecondition(folder.Open(folder_, true)));
  fs::create_symlink("/dev/null", path_);
  NewFile link;
  EXPECT_TRUE(absl::IsFailedPrecondition(link.Open(path_, true)));
  NewFile nowhere;
  EXPECT_TRUE(
      absl::IsFailedPrecondition(nowhere.Open(folder_ / "no" / "file", false)));
}

}  // namespace
}  // namespace selfcal::client
