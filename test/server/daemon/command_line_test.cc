// The command line as a program, on a daemon as a program.
#include <gmock/gmock.h>

#include <filesystem>
#include <string>
#include <vector>

#include "test/server/daemon/daemon_fixture.h"
#include "test/support/certificates.h"

namespace selfcal::server {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class CommandLineTest : public DaemonTest {
 protected:
  struct Outcome {
    int code;
    std::string text;  // of both streams
  };

  Outcome Selfcal(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), SELFCAL_PATH);
    arguments.insert(arguments.end(), connection_.begin(), connection_.end());
    const auto output = folder_ / ("output" + std::to_string(++runs_));
    Process selfcal(arguments, output);
    const int code = selfcal.Wait().value_or(-1);
    return {code, selfcal.Log()};
  }

  // How to reach the daemon.
  std::vector<std::string> connection_ = {
      "--target", "unix:" + (state_ / "selfcald.sock").string()};

 private:
  int runs_ = 0;
};

TEST_F(CommandLineTest, BacksUpChecksAndRestoresWhileTheDaemonRuns) {
  const auto daemon = StartAndWait();
  const Rig rig = CreateRig();
  const std::string backup = folder_ / "backup.db";
  Outcome outcome = Selfcal({"backup", backup});
  ASSERT_EQ(outcome.code, 0) << outcome.text;

  Stream(TestSegments(rig, 2));
  ASSERT_TRUE(AllScored());
  outcome = Selfcal({"doctor"});
  EXPECT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("problems\t0"));
  outcome = Selfcal({"events", "r", "--kind", "rig-created"});
  EXPECT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("\tr\trig created\t"));

  // Once it returns the daemon serves what the backup holds.
  outcome = Selfcal({"restore", backup, "--yes"});
  ASSERT_EQ(outcome.code, 0) << outcome.text << daemon->Log();
  EXPECT_THAT(outcome.text, HasSubstr("selfcal.db.before-restore-"));
  outcome = Selfcal({"segments", "list", "r"});
  EXPECT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_EQ(outcome.text, "");

  // A damaged one is refused, and changes nothing.
  std::filesystem::resize_file(backup, std::filesystem::file_size(backup) / 2);
  outcome = Selfcal({"restore", backup, "--yes"});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_THAT(
      outcome.text,
      AllOf(HasSubstr("the backup is damaged"), Not(HasSubstr("previous"))));
  EXPECT_EQ(Selfcal({"rig", "show", "r"}).code, 0);
  daemon->Signal(SIGTERM);
  EXPECT_EQ(daemon->Wait(), 0);
}

TEST_F(CommandLineTest, DoesOverMutualTlsWhatItsCertificateSays) {
  Certificates certificates;
  certificates.Add("operator", "ca", "URI:selfcal://role/administer");
  certificates.Add("device", "ca", "URI:selfcal://role/produce/rigs/r");
  const auto daemon = StartWithTls(certificates);
  CreateRig();
  const std::string address = "127.0.0.1:" + daemon->Word("127.0.0.1:");
  const auto as = [&](const std::string& name) {
    connection_ = {"--target",
                   address,
                   "--ca",
                   certificates.Pem("ca"),
                   "--cert",
                   certificates.Pem(name),
                   "--key",
                   certificates.Key(name)};
  };

  as("device");
  EXPECT_EQ(Selfcal({"rig", "show", "r"}).code, 0);
  EXPECT_EQ(Selfcal({"backup", folder_ / "stolen.db"}).code, 1);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "stolen.db"));

  as("operator");
  const std::string backup = folder_ / "backup.db";
  for (const std::vector<std::string>& command :
       std::vector<std::vector<std::string>>{{"rig", "list"},
                                             {"segments", "list", "r"},
                                             {"tables", "r"},
                                             {"calibrations", "show", "r"},
                                             {"events"},
                                             {"doctor"},
                                             {"backup", backup}}) {
    const Outcome outcome = Selfcal(command);
    EXPECT_EQ(outcome.code, 0) << command[0] << ": " << outcome.text;
  }
  daemon->Signal(SIGTERM);
  EXPECT_EQ(daemon->Wait(), 0);
}

TEST_F(CommandLineTest, ChangesTheFullScaleOfOneSensorAlone) {
  const auto daemon = StartAndWait();
  CreateRig();
  Outcome outcome = Selfcal({"rig", "update", "r", "--accel-max", "78.5"});
  EXPECT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_EQ(outcome.text, "changed\timu\n");
  outcome = Selfcal({"rig", "update", "r", "--gyro-max", "8.75"});
  EXPECT_EQ(outcome.code, 0) << outcome.text;
  outcome = Selfcal({"rig", "show", "r", "--json"});
  EXPECT_THAT(
      outcome.text,
      AllOf(HasSubstr("\"gyro_max\": 8.75"), HasSubstr("\"accel_max\": 78.5")));
  // The message names the flag.
  outcome = Selfcal({"rig", "update", "r", "--gyro-max", "-1"});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("--gyro-max"));
}

}  // namespace
}  // namespace selfcal::server
