#include "server/daemon/options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <fstream>
#include <regex>
#include <set>

#include "server/daemon/settings.h"
#include "test/support/files.h"
#include "test/support/temp_folder.h"

namespace selfcal::server {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class OptionsTest : public ::testing::Test {
 protected:
  OptionsTest() {
    for (const char* name : {"STATE_DIRECTORY",
                             "RUNTIME_DIRECTORY",
                             "SELFCAL_STATE_DIR",
                             "SELFCAL_LISTEN",
                             "SELFCAL_SCORING_THREADS",
                             "SELFCAL_CONFIG"}) {
      unsetenv(name);
    }
  }

  std::string File(const std::string& text) {
    std::string file = folder_.File("selfcald.toml");
    WriteBytes(file, text);
    return file;
  }

  // What the file is told to be wrong with.
  std::string MistakeIn(const std::string& text) {
    ::testing::internal::CaptureStderr();
    EXPECT_EQ(Parse({"--state-dir", "s", "--config", File(text)}), 2) << text;
    return ::testing::internal::GetCapturedStderr();
  }

  std::optional<int> Parse(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "selfcald");
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    options_ = DaemonOptions();
    return ParseOptions(static_cast<int>(argv.size()), argv.data(), &options_);
  }

  const TempFolder folder_;
  DaemonOptions options_;
};

TEST_F(OptionsTest, StateFolderAloneIsEnough) {
  EXPECT_EQ(Parse({"--state-dir", "/var/lib/selfcal"}), std::nullopt);
  EXPECT_EQ(options_.state_dir, "/var/lib/selfcal");
  EXPECT_THAT(options_.server.listen,
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

TEST_F(OptionsTest, ScorerHasANameAndVerificationAShare) {
  EXPECT_EQ(Parse({"--state-dir", "s"}), std::nullopt);
  EXPECT_EQ(options_.scorer, ScorerKind::kStructured);
  EXPECT_EQ(options_.verify_share, 0);
  EXPECT_EQ(
      Parse(
          {"--state-dir", "s", "--scorer", "ceres", "--verify-share", "0.25"}),
      std::nullopt);
  EXPECT_EQ(options_.scorer, ScorerKind::kCeres);
  EXPECT_EQ(options_.verify_share, 0.25);
  EXPECT_EQ(Parse({"--state-dir", "s", "--scorer", "other"}), 2);
  EXPECT_EQ(Parse({"--state-dir", "s", "--verify-share", "1.5"}), 2);
}

TEST_F(OptionsTest, RunsAreDeferredAndLimitedAsSet) {
  EXPECT_EQ(Parse({"--state-dir", "s"}), std::nullopt);
  EXPECT_EQ(options_.host, HostLimits());
  EXPECT_EQ(options_.max_run_minutes, 30);
  EXPECT_EQ(options_.max_run_memory_mib, 512);
  EXPECT_EQ(options_.session_idle_s, 60);
  EXPECT_FALSE(options_.idle_runs);
  EXPECT_EQ(Parse({"--state-dir",
                   "s",
                   "--only-on-external-power",
                   "--max-load",
                   "0.5",
                   "--max-run-minutes",
                   "2.5",
                   "--max-run-memory",
                   "100",
                   "--session-idle",
                   "0.5",
                   "--run-priority",
                   "idle"}),
            std::nullopt);
  EXPECT_TRUE(options_.idle_runs);
  EXPECT_TRUE(options_.host.only_on_external_power);
  EXPECT_EQ(options_.host.max_load, 0.5);
  EXPECT_EQ(options_.max_run_minutes, 2.5);
  EXPECT_EQ(options_.max_run_memory_mib, 100);
  EXPECT_EQ(options_.session_idle_s, 0.5);
  EXPECT_EQ(Parse({"--state-dir", "s", "--max-load", "-1"}), 2);
  EXPECT_EQ(Parse({"--state-dir", "s", "--max-run-minutes", "0"}), 2);
  EXPECT_EQ(Parse({"--state-dir", "s", "--max-run-memory", "-1"}), 2);
}

TEST_F(OptionsTest, ConsoleIsOffAndOnlyReadsUnlessToldOtherwise) {
  EXPECT_EQ(Parse({"--state-dir", "s"}), std::nullopt);
  EXPECT_EQ(options_.console, "off");
  EXPECT_EQ(options_.console_role, Role::kRead);
  EXPECT_EQ(Parse({"--state-dir",
                   "s",
                   "--console",
                   "127.0.0.1:7448",
                   "--console-role",
                   "administer"}),
            std::nullopt);
  EXPECT_EQ(options_.console, "127.0.0.1:7448");
  EXPECT_EQ(options_.console_role, Role::kAdminister);
  EXPECT_EQ(Parse({"--state-dir", "s", "--console-role", "all"}), 2);
}

TEST_F(OptionsTest, TestForAChangeIsSet) {
  EXPECT_EQ(Parse({"--state-dir", "s"}), std::nullopt);
  EXPECT_EQ(options_.domain.change.inflation, std::nullopt);
  EXPECT_EQ(Parse({"--state-dir",
                   "s",
                   "--change-inflation",
                   "1",
                   "--change-false-alarms",
                   "1e-4"}),
            std::nullopt);
  EXPECT_EQ(options_.domain.change.inflation, 1);
  EXPECT_EQ(options_.domain.change.false_alarm_rate, 1e-4);
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
  EXPECT_THAT(options_.server.listen, ElementsAre("unix:/a", "127.0.0.1:0"));
}

TEST_F(OptionsTest, FolderMayComeFromTheServiceManager) {
  setenv("STATE_DIRECTORY", "/var/lib/other", 1);
  EXPECT_EQ(Parse({}), std::nullopt);
  EXPECT_EQ(options_.state_dir, "/var/lib/other");
}

TEST_F(OptionsTest, SocketIsInTheFolderOfTheServiceManager) {
  setenv("RUNTIME_DIRECTORY", "/run/selfcal", 1);
  EXPECT_EQ(Parse({"--state-dir", "/s"}), std::nullopt);
  EXPECT_THAT(options_.server.listen,
              ElementsAre("unix:/run/selfcal/selfcald.sock"));
}

TEST_F(OptionsTest, FlagGoesBeforeEnvironmentBeforeFileBeforeDefault) {
  const std::string file = File(
      "state-dir = \"/from/file\"\n"
      "listen = [\"unix:/a\", \"unix:/b\"]\n"
      "scoring-threads = 3\n"
      "max-backlog = 5\n"
      "max-rigs = 7\n");
  setenv("SELFCAL_SCORING_THREADS", "4", 1);
  setenv("SELFCAL_MAX_BACKLOG", "6", 1);
  setenv("STATE_DIRECTORY", "/from/manager", 1);
  EXPECT_EQ(Parse({"--config", file, "--scoring-threads", "2"}), std::nullopt);
  unsetenv("SELFCAL_MAX_BACKLOG");
  EXPECT_EQ(options_.state_dir, "/from/file");
  EXPECT_THAT(options_.server.listen, ElementsAre("unix:/a", "unix:/b"));
  EXPECT_EQ(options_.scoring_threads, 2);
  EXPECT_EQ(options_.max_backlog, 6);
  EXPECT_EQ(options_.domain.quotas.max_rigs, 7);
  EXPECT_EQ(options_.metrics, "off");
}

TEST_F(OptionsTest, EnvironmentGivesListsWithCommas) {
  setenv("SELFCAL_LISTEN", "unix:/a,unix:/b", 1);
  setenv("SELFCAL_STATE_DIR", "/from/environment", 1);
  EXPECT_EQ(Parse({}), std::nullopt);
  EXPECT_EQ(options_.state_dir, "/from/environment");
  EXPECT_THAT(options_.server.listen, ElementsAre("unix:/a", "unix:/b"));
}

TEST_F(OptionsTest, MistakesOfTheFileAreNamedWithTheirLine) {
  EXPECT_THAT(MistakeIn("max-rigs = 1\nscoring-treads = 3\n"),
              AllOf(HasSubstr(".toml:2:1: "), HasSubstr("scoring-treads")));
  EXPECT_THAT(MistakeIn("\n\nscoring-threads = 0\n"),
              AllOf(HasSubstr(".toml:3:1: "), HasSubstr("scoring-threads")));
  EXPECT_THAT(MistakeIn("local-role = \"root\"\n"),
              AllOf(HasSubstr(".toml:1:1: "), HasSubstr("root")));
  EXPECT_THAT(MistakeIn("socket-mode = \"0999\"\n"),
              AllOf(HasSubstr(".toml:1:1: "), HasSubstr("0999")));
  EXPECT_THAT(MistakeIn("metrics = true\n"), HasSubstr(".toml:1:1: "));
  EXPECT_THAT(MistakeIn("[server]\nlisten = \"unix:/a\"\n"),
              HasSubstr(".toml:1:"));
  EXPECT_THAT(MistakeIn("log-level = \"info\"\nmax-rigs = = 2\n"),
              HasSubstr(".toml:2:"));
  EXPECT_THAT(MistakeIn("config = \"/other\"\n"), HasSubstr(".toml:1:1: "));
  EXPECT_THAT(MistakeIn("help = \"me\"\n"), HasSubstr("no setting 'help'"));
}

TEST_F(OptionsTest, AFileThatCannotBeReadIsNamedWithTheReason) {
  for (const auto& [path, reason] :
       {std::pair("/nowhere/selfcald.toml", "No such file or directory"),
        std::pair("/", "Is a directory")}) {
    ::testing::internal::CaptureStderr();
    EXPECT_EQ(Parse({"--state-dir", "s", "--config", path}), 2);
    EXPECT_EQ(::testing::internal::GetCapturedStderr(),
              "cannot read " + std::string(path) + ": " + reason + "\n");
  }
}

// The file that is installed: each setting is in it, what it shows as default
// is the default, and its examples can be used.
TEST_F(OptionsTest, ExampleFileShowsEverySettingAndItsDefault) {
  std::ifstream example(SELFCAL_EXAMPLE_CONFIG);
  std::string defaults, examples;
  std::set<std::string> names;
  for (std::string line; std::getline(example, line);) {
    std::smatch match;
    static const std::regex kSetting("#( ?)(([a-z-]+) = .*)");
    if (!std::regex_match(line, match, kSetting)) continue;
    EXPECT_TRUE(names.insert(match[3]).second) << match[3];
    (match[1].length() == 0 ? defaults : examples) += match[2].str() + "\n";
  }
  EXPECT_EQ(Parse({"--state-dir", "s", "--config", File(defaults)}),
            std::nullopt);
  const DaemonOptions shown = options_;
  EXPECT_EQ(Parse({"--state-dir", "s"}), std::nullopt);
  EXPECT_EQ(shown, options_);
  EXPECT_EQ(Parse({"--config", File(examples)}), std::nullopt);

  CLI::App app;
  DaemonOptions options;
  DefineSettings(&app, Environment::kIgnore, &options);
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_name() == "--help") continue;
    EXPECT_EQ(names.erase(option->get_name().substr(2)), 1u)
        << option->get_name() << " is not in the example";
  }
  EXPECT_THAT(names, IsEmpty());
}

TEST_F(OptionsTest, MistakesEndWithTwo) {
  EXPECT_EQ(Parse({}), 2);
  EXPECT_EQ(Parse({"--state-dir", "s", "--no-such-flag"}), 2);
  EXPECT_EQ(Parse({"--state-dir", "s", "--scoring-threads", "0"}), 2);
  EXPECT_EQ(Parse({"--state-dir", "s", "--scoring-threads", "many"}), 2);
  EXPECT_EQ(Parse({"--state-dir", "s", "--log-level", "loud"}), 2);
  EXPECT_EQ(Parse({"--state-dir", "s", "--config", "/no/such/file"}), 2);
  setenv("SELFCAL_SCORING_THREADS", "many", 1);
  EXPECT_EQ(Parse({"--state-dir", "s"}), 2);
  unsetenv("SELFCAL_SCORING_THREADS");
}

TEST_F(OptionsTest, HelpAndVersionEndWithZero) {
  EXPECT_EQ(Parse({"--help"}), 0);
  EXPECT_EQ(Parse({"--version"}), 0);
}

}  // namespace
}  // namespace selfcal::server
