#include "server/daemon/options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <fstream>

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;

class OptionsTest : public ::testing::Test {
 protected:
  OptionsTest() { unsetenv("STATE_DIRECTORY"); }

  std::optional<int> Parse(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "selfcald");
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    options_ = DaemonOptions();
    return ParseOptions(static_cast<int>(argv.size()), argv.data(), &options_);
  }

  DaemonOptions options_;
};

TEST_F(OptionsTest, StateFolderAloneIsEnough) {
  EXPECT_EQ(Parse({"--state-dir", "/var/lib/selfcal"}), std::nullopt);
  EXPECT_EQ(options_.state_dir, "/var/lib/selfcal");
  EXPECT_THAT(options_.listen,
              ElementsAre("unix:/var/lib/selfcal/selfcald.sock"));
  EXPECT_EQ(options_.scoring_threads, 1);
  EXPECT_EQ(options_.solver, SolverKind::kStructured);
  EXPECT_EQ(options_.log_level, "info");
}

TEST_F(OptionsTest, SolverHasAName) {
  EXPECT_EQ(Parse({"--state-dir", "s", "--solver", "ceres"}), std::nullopt);
  EXPECT_EQ(options_.solver, SolverKind::kCeres);
  EXPECT_EQ(Parse({"--state-dir", "s", "--solver", "structured"}),
            std::nullopt);
  EXPECT_EQ(options_.solver, SolverKind::kStructured);
  EXPECT_EQ(Parse({"--state-dir", "s", "--solver", "other"}), 2);
}

TEST_F(OptionsTest, RunsAreHeldBackAndLimitedAsSet) {
  EXPECT_EQ(Parse({"--state-dir", "s"}), std::nullopt);
  EXPECT_EQ(options_.host, HostLimits());
  EXPECT_EQ(options_.max_run_minutes, 30);
  EXPECT_TRUE(options_.idle_runs);
  EXPECT_EQ(Parse({"--state-dir",
                   "s",
                   "--only-on-external-power",
                   "--max-load",
                   "0.5",
                   "--max-run-minutes",
                   "2.5",
                   "--run-priority",
                   "low"}),
            std::nullopt);
  EXPECT_FALSE(options_.idle_runs);
  EXPECT_TRUE(options_.host.only_on_external_power);
  EXPECT_EQ(options_.host.max_load, 0.5);
  EXPECT_EQ(options_.max_run_minutes, 2.5);
  EXPECT_EQ(Parse({"--state-dir", "s", "--max-load", "-1"}), 2);
  EXPECT_EQ(Parse({"--state-dir", "s", "--max-run-minutes", "0"}), 2);
}

TEST_F(OptionsTest, TestForAChangeIsSet) {
  EXPECT_EQ(Parse({"--state-dir", "s"}), std::nullopt);
  EXPECT_EQ(options_.change.inflation, std::nullopt);
  EXPECT_EQ(Parse({"--state-dir",
                   "s",
                   "--change-inflation",
                   "1",
                   "--change-false-alarms",
                   "1e-4"}),
            std::nullopt);
  EXPECT_EQ(options_.change.inflation, 1);
  EXPECT_EQ(options_.change.false_alarm_rate, 1e-4);
  EXPECT_EQ(Parse({"--state-dir", "s", "--change-inflation", "0.5"}), 2);
  EXPECT_EQ(Parse({"--state-dir", "s", "--change-false-alarms", "2"}), 2);
}

TEST_F(OptionsTest, AddressesAreRepeatable) {
  EXPECT_EQ(Parse({"--state-dir",
                   "s",
                   "--listen",
                   "unix:/a",
                   "--listen",
                   "127.0.0.1:0"}),
            std::nullopt);
  EXPECT_THAT(options_.listen, ElementsAre("unix:/a", "127.0.0.1:0"));
}

TEST_F(OptionsTest, FolderMayComeFromTheServiceManager) {
  setenv("STATE_DIRECTORY", "/var/lib/other", 1);
  EXPECT_EQ(Parse({}), std::nullopt);
  EXPECT_EQ(options_.state_dir, "/var/lib/other");
}

TEST_F(OptionsTest, FileGivesWhatFlagsDoNot) {
  const std::string file = ::testing::TempDir() + "selfcald_options_test.toml";
  std::ofstream(file) << "state-dir = \"/from/file\"\n"
                         "listen = [\"unix:/a\", \"unix:/b\"]\n"
                         "scoring-threads = 3\n";
  EXPECT_EQ(Parse({"--config", file, "--scoring-threads", "2"}), std::nullopt);
  EXPECT_EQ(options_.state_dir, "/from/file");
  EXPECT_THAT(options_.listen, ElementsAre("unix:/a", "unix:/b"));
  EXPECT_EQ(options_.scoring_threads, 2);
}

TEST_F(OptionsTest, MisspeltNameInTheFileIsAMistake) {
  const std::string file = ::testing::TempDir() + "selfcald_misspelt.toml";
  std::ofstream(file) << "state-dir = \"/from/file\"\nscoring-treads = 3\n";
  EXPECT_EQ(Parse({"--config", file}), 2);
}

TEST_F(OptionsTest, MistakesEndWithTwo) {
  EXPECT_EQ(Parse({}), 2);
  EXPECT_EQ(Parse({"--state-dir", "s", "--no-such-flag"}), 2);
  EXPECT_EQ(Parse({"--state-dir", "s", "--scoring-threads", "0"}), 2);
  EXPECT_EQ(Parse({"--state-dir", "s", "--scoring-threads", "many"}), 2);
  EXPECT_EQ(Parse({"--state-dir", "s", "--log-level", "loud"}), 2);
  EXPECT_EQ(Parse({"--config", "/no/such/file"}), 2);
}

TEST_F(OptionsTest, HelpAndVersionEndWithZero) {
  EXPECT_EQ(Parse({"--help"}), 0);
  EXPECT_EQ(Parse({"--version"}), 0);
}

}  // namespace
}  // namespace selfcal::server
