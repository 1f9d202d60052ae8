// doctor, backup, restore and events against a daemon with canned answers.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <string>
#include <vector>

#include "test/client/cli/canned_store.h"
#include "test/client/cli/commands_fixture.h"
#include "test/support/files.h"
#include "test/support/temp_folder.h"

namespace selfcal::client {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class StoreCommands : public ::testing::Test {
 protected:
  int Selfcal(std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--target", daemon_.target});
    Outcome outcome = client::Selfcal(arguments);
    out_ = std::move(outcome.out);
    err_ = std::move(outcome.err);
    return outcome.code;
  }
  // The same with `answer` on its standard input.
  int Answering(const std::string& answer,
                const std::vector<std::string>& arguments) {
    int ends[2];
    EXPECT_EQ(pipe(ends), 0);
    EXPECT_EQ(write(ends[1], answer.data(), answer.size()),
              static_cast<ssize_t>(answer.size()));
    close(ends[1]);
    const int kept = dup(STDIN_FILENO);
    dup2(ends[0], STDIN_FILENO);
    std::clearerr(stdin);  // of an answer before that had ended
    std::cin.clear();
    const int code = Selfcal(arguments);
    dup2(kept, STDIN_FILENO);
    close(kept);
    close(ends[0]);
    return code;
  }
  std::string Content() const { return ReadBytes(file_); }
  int Files() const {
    return static_cast<int>(std::distance(fs::directory_iterator(folder_), {}));
  }
  // What looks like a backup of some megabytes.
  std::string WriteBackup() const {
    std::string bytes("SQLite format 3\0", 16);
    bytes.resize(68, 'x');
    bytes += "SCAL" + std::string(3'000'000, 'b');
    WriteBytes(file_, bytes);
    return bytes;
  }

  CannedStore daemon_;
  const TempFolder temp_folder_;
  const fs::path folder_ = temp_folder_.path();
  const fs::path file_ = folder_ / "backup.db";
  std::string out_;
  std::string err_;
};

TEST_F(StoreCommands, DoctorSaysWhatIsWrongByItsExitCodeToo) {
  EXPECT_EQ(Selfcal({"doctor"}), 0) << err_;
  EXPECT_THAT(out_, HasSubstr("problems\t0\n"));
  EXPECT_THAT(out_, HasSubstr("checksums\t12\n"));
  daemon_.problems = 2;
  EXPECT_EQ(Selfcal({"doctor"}), 4);
  const std::string line =
      "problem\tpayloads, data of row 7\tits checksum does not match\n";
  EXPECT_THAT(out_, HasSubstr(line + line));
  EXPECT_THAT(out_, HasSubstr("problems\t2\n"));
  EXPECT_EQ(Selfcal({"doctor", "--json"}), 4);
  EXPECT_EQ(std::count(out_.begin(), out_.end(), '\n'), 3);
  EXPECT_THAT(out_, HasSubstr("{\"problem\":{\"place\":"));
}

TEST_F(StoreCommands, DoctorTellsDamageFromACheckThatDidNotEnd) {
  daemon_.check_status = {grpc::StatusCode::PERMISSION_DENIED, "not you"};
  EXPECT_EQ(Selfcal({"doctor"}), 1);
  EXPECT_THAT(err_, HasSubstr("not you"));
  daemon_.check_status = {grpc::StatusCode::UNAVAILABLE, "the daemon stops"};
  EXPECT_EQ(Selfcal({"doctor"}), 3);
  // What was found before the end is damage all the same.
  daemon_.problems = 1;
  EXPECT_EQ(Selfcal({"doctor"}), 4);
  daemon_.problems = 0;
  daemon_.check_status = {grpc::StatusCode::DATA_LOSS, "malformed"};
  EXPECT_EQ(Selfcal({"doctor"}), 4);
}

TEST_F(StoreCommands, BackupWritesTheWholeFile) {
  EXPECT_EQ(Selfcal({"backup", file_}), 0) << err_;
  EXPECT_EQ(Content(), "one two");
  EXPECT_EQ(Files(), 1);
  // printf 'one two' | sha256sum
  EXPECT_THAT(out_,
              HasSubstr("sha256\t"
                        "8ab63e29a4ba14e4e1688f9c15e5af90"
                        "895421358c945b0431f85d66977bd3d2\n"));
}

TEST_F(StoreCommands, JsonHasTheSameFormOfTheChecksum) {
  EXPECT_EQ(Selfcal({"daemon", "backup", file_, "--json"}), 0) << err_;
  EXPECT_THAT(out_,
              HasSubstr("\"sha256\": \"8ab63e29a4ba14e4e1688f9c15e5af90"
                        "895421358c945b0431f85d66977bd3d2\""));
}

TEST_F(StoreCommands, BackupOverwritesOnlyWithForce) {
  std::ofstream(file_) << "precious";
  EXPECT_EQ(Selfcal({"backup", file_}), 2);
  EXPECT_THAT(err_, AllOf(HasSubstr(file_), HasSubstr("--force")));
  EXPECT_EQ(Content(), "precious");
  EXPECT_EQ(Selfcal({"backup", file_, "--force"}), 0) << err_;
  EXPECT_EQ(Content(), "one two");
}

TEST_F(StoreCommands, BackupLeavesNothingThatIsNotWhole) {
  daemon_.backup_checksum = std::string(32, 'x');
  EXPECT_EQ(Selfcal({"backup", file_}), 1);
  EXPECT_THAT(err_, HasSubstr("the backup is incomplete"));
  EXPECT_EQ(Files(), 0);
  daemon_.backup_status = {grpc::StatusCode::RESOURCE_EXHAUSTED, "disk full"};
  EXPECT_EQ(Selfcal({"backup", file_}), 1);
  EXPECT_THAT(err_, HasSubstr("disk full"));
  EXPECT_EQ(Files(), 0);
  // Nor does it take away what was there.
  std::ofstream(file_) << "precious";
  EXPECT_EQ(Selfcal({"backup", file_, "--force"}), 1);
  EXPECT_EQ(Content(), "precious");
  EXPECT_EQ(Files(), 1);
}

TEST_F(StoreCommands, RestoreSendsTheFileAndWaitsForTheNewStart) {
  const std::string bytes = WriteBackup();
  EXPECT_EQ(Selfcal({"restore", file_, "--yes"}), 0) << err_;
  EXPECT_EQ(daemon_.restored, bytes);
  EXPECT_EQ(daemon_.starts, 2);
  EXPECT_THAT(out_, HasSubstr("previous database\t/var/before\n"));
}

TEST_F(StoreCommands, RestoreSaysIfTheDaemonDoesNotStartAnew) {
  WriteBackup();
  daemon_.restarts = false;
  EXPECT_EQ(Selfcal({"restore", file_, "--yes", "--timeout", "0.2"}), 3);
  EXPECT_THAT(err_, HasSubstr("did not restart within 0.2 s"));
  EXPECT_THAT(out_, HasSubstr("/var/before"));
}

TEST_F(StoreCommands, RestoreAsksFirst) {
  WriteBackup();
  for (const std::string answer : {"", "n\n", "\n", "what?\n"}) {
    EXPECT_EQ(Answering(answer, {"restore", file_}), 2);
    EXPECT_THAT(err_, AllOf(HasSubstr("[y/N]"), HasSubstr("--yes")));
    EXPECT_EQ(daemon_.restored, "");
  }
  EXPECT_EQ(Answering("y\n", {"restore", file_}), 0) << err_;
  EXPECT_NE(daemon_.restored, "");
}

TEST_F(StoreCommands, RestoreSendsNothingThatIsNoBackup) {
  EXPECT_EQ(Selfcal({"restore", "/nonexistent/file", "--yes"}), 2);
  EXPECT_EQ(Selfcal({"restore", folder_, "--yes"}), 2);
  for (const std::string& content :
       {std::string(), std::string("a text"), std::string(100, '\0')}) {
    std::ofstream(file_) << content;
    EXPECT_EQ(Selfcal({"restore", file_, "--yes"}), 2);
    EXPECT_THAT(err_, HasSubstr("is not a backup"));
  }
  EXPECT_EQ(daemon_.restored, "");
}

TEST_F(StoreCommands, RestorePassesOnARefusal) {
  WriteBackup();
  daemon_.restore_status = {grpc::StatusCode::DATA_LOSS, "is damaged"};
  EXPECT_EQ(Selfcal({"restore", file_, "--yes"}), 1);
  EXPECT_THAT(err_, HasSubstr("is damaged"));
  EXPECT_EQ(out_, "");
}

TEST_F(StoreCommands, EventsAreThoseOfEveryPage) {
  daemon_.AddEvents(5);
  EXPECT_EQ(Selfcal({"events"}), 0) << err_;
  EXPECT_EQ(std::count(out_.begin(), out_.end(), '\n'), 5);
  EXPECT_THAT(out_,
              HasSubstr("2\t2026-11-21 02:00:00\ta\tdata evicted\tthe quota"));
  EXPECT_EQ(daemon_.parent, "");
  EXPECT_EQ(Selfcal({"events", "a", "--json"}), 0);
  EXPECT_EQ(daemon_.parent, "rigs/a");
  EXPECT_THAT(out_, HasSubstr("\"kind\": \"DATA_EVICTED\""));
}

TEST_F(StoreCommands, EventsCanBeChosen) {
  daemon_.AddEvents(5);  // 1: run started, 2: data evicted, 3: ...
  EXPECT_EQ(Selfcal({"events", "--kind", "data-evicted"}), 0) << err_;
  EXPECT_EQ(std::count(out_.begin(), out_.end(), '\n'), 2);
  EXPECT_EQ(
      Selfcal({"events", "--kind", "data-evicted", "--kind", "run-started"}),
      0);
  EXPECT_EQ(std::count(out_.begin(), out_.end(), '\n'), 5);
  EXPECT_EQ(Selfcal({"events", "--since", "2026-11-21 04:00:00"}), 0);
  EXPECT_THAT(out_, AllOf(HasSubstr("4\t2026"), HasSubstr("5\t2026")));
  EXPECT_EQ(std::count(out_.begin(), out_.end(), '\n'), 2);
  EXPECT_EQ(Selfcal({"events", "--since", "1h"}), 0);
  EXPECT_EQ(out_, "");
  EXPECT_EQ(Selfcal({"events", "--limit", "1"}), 0);
  EXPECT_THAT(out_, AllOf(HasSubstr("5\t2026"), Not(HasSubstr("4\t2026"))));
  EXPECT_EQ(Selfcal({"events", "--kind", "nonsense"}), 2);
  EXPECT_THAT(err_, HasSubstr("change-detected"));
  EXPECT_EQ(Selfcal({"events", "--since", "nonsense"}), 2);
}

TEST_F(StoreCommands, ADaemonThatIsAwayExitsWithThree) {
  WriteBackup();
  daemon_.target = "unix:" + (folder_ / "nobody.sock").string();
  for (const std::vector<std::string>& line :
       std::vector<std::vector<std::string>>{{"doctor"},
                                             {"events"},
                                             {"backup", folder_ / "other"},
                                             {"restore", file_, "--yes"}}) {
    EXPECT_EQ(Selfcal(line), 3) << line[0];
    EXPECT_THAT(err_, HasSubstr("Is selfcald running?"));
    EXPECT_EQ(out_, "");
  }
  EXPECT_EQ(Files(), 1);
}

}  // namespace
}  // namespace selfcal::client
