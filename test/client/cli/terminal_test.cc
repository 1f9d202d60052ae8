// What a terminal shows: colours, and columns that fit its width.
#include "client/cli/terminal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pty.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <string>
#include <vector>

#include "client/cli/table.h"
#include "test/client/cli/commands_fixture.h"

namespace selfcal::client {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

TEST(ShortenedInTheMiddle, KeepsBeginAndEnd) {
  EXPECT_EQ(ShortenedInTheMiddle("walk~3", 6), "walk~3");
  EXPECT_EQ(ShortenedInTheMiddle("walk_in_the_garden~3", 11), "walk...en~3");
  EXPECT_EQ(ShortenedInTheMiddle("abcdef", 2), "ab");
  EXPECT_EQ(ShortenedInTheMiddle("\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4", 4),
            "\xc3\xa4...")
      << "characters, not bytes";
}

TEST(TableOnATerminal, FitsByShorteningTheWidestNames) {
  Table table({{"segment"}, {"entropy", true}, {"problem"}});
  table.Add({"a_very_long_name_of_a_session~12",
             "-12.345",
             "a long text that explains what was wrong"});
  EXPECT_EQ(table.Aligned({.columns = 60}),
            "segment                   entropy  problem\n"
            "a_very_long...session~12  -12.345  a long text...t was wrong\n")
      << table.Aligned({.columns = 60});
  EXPECT_EQ(table.Aligned(), table.Aligned({.columns = 200}));
  // Numbers, and columns that would be illegible, stay.
  EXPECT_THAT(table.Aligned({.columns = 10}), HasSubstr("-12.345"));
}

TEST(TableOnATerminal, ContinuesTextsOnTheLinesBelow) {
  Table table({{"run", true}, {"message", false, true}});
  table.Add({"7", "one two three four five six seven eight nine"});
  table.Add({"8", std::string(40, 'x')});
  EXPECT_EQ(table.Aligned({.columns = 35}),
            "run  message\n"
            "  7  one two three four five six\n"
            "     seven eight nine\n"
            "  8  " +
                std::string(30, 'x') + "\n     " + std::string(10, 'x') + "\n");
}

TEST(TableOnATerminal, ColoursStatesVerdictsAndHeaders) {
  Table table({{"version", true}, {"state"}, {"reason"}});
  table.Add({"1", "active", "active"});
  table.Add({"2", "rejected", ""});
  EXPECT_EQ(table.Aligned({.color = true}),
            "\033[1mversion\033[0m  \033[1mstate   \033[0m  "
            "\033[1mreason\033[0m\n"
            "      1  \033[32mactive  \033[0m  active\n"
            "      2  \033[31mrejected\033[0m\n");
  EXPECT_THAT(table.Aligned(), Not(HasSubstr("\033")));
  Facts facts;
  facts.Add("verdict", "weak");
  EXPECT_EQ(facts.Aligned({.color = true}), "verdict  \033[33mweak\033[0m\n");
}

TEST(Color, IsUsedOnATerminalUnlessTheUserDoesNotWantIt) {
  unsetenv("NO_COLOR");
  setenv("TERM", "xterm", 1);
  EXPECT_TRUE(UsesColor(ColorMode::kAuto, true));
  EXPECT_FALSE(UsesColor(ColorMode::kAuto, false));
  EXPECT_FALSE(UsesColor(ColorMode::kNever, true));
  EXPECT_TRUE(UsesColor(ColorMode::kAlways, false));
  setenv("NO_COLOR", "1", 1);
  EXPECT_FALSE(UsesColor(ColorMode::kAuto, true));
  EXPECT_TRUE(UsesColor(ColorMode::kAlways, true));
  setenv("NO_COLOR", "", 1);
  EXPECT_TRUE(UsesColor(ColorMode::kAuto, true)) << "empty is as if not set";
  setenv("TERM", "dumb", 1);
  EXPECT_FALSE(UsesColor(ColorMode::kAuto, true));
}

// Stdout is a terminal of this width while it exists.
class Terminal {
 public:
  explicit Terminal(unsigned short columns) {
    std::fflush(stdout);
    winsize size{24, columns, 0, 0};
    EXPECT_EQ(openpty(&reader_, &writer_, nullptr, nullptr, &size), 0);
    before_ = dup(STDOUT_FILENO);
    dup2(writer_, STDOUT_FILENO);
  }
  // Ends it, and returns what was written, up to 4 kB.
  std::string Read() {
    std::fflush(stdout);
    std::array<char, 4096> text{};
    const ssize_t size = read(reader_, text.data(), text.size());
    return {text.data(), static_cast<std::size_t>(std::max<ssize_t>(size, 0))};
  }
  ~Terminal() {
    dup2(before_, STDOUT_FILENO);
    for (const int file : {before_, reader_, writer_}) close(file);
  }

 private:
  int reader_ = -1;
  int writer_ = -1;
  int before_ = -1;
};

class OnATerminal : public Commands {
 protected:
  OnATerminal() {
    unsetenv("NO_COLOR");
    setenv("TERM", "xterm", 1);
    v1::Recalibration run;
    run.set_name("rigs/device/recalibrations/3");
    run.set_state(v1::Recalibration::FAILED);
    run.set_message("a message that is much longer than a terminal is wide, " +
                    std::string(120, 'x') + " and has an end");
    daemon_.run = {run};
  }
  std::string Shown(std::vector<std::string> arguments,
                    unsigned short columns = 100) const {
    arguments.insert(arguments.end(), {"--target", daemon_.target});
    std::vector<const char*> argv = {"selfcal"};
    for (const std::string& one : arguments) argv.push_back(one.c_str());
    Terminal terminal(columns);
    RunCommandLine(static_cast<int>(argv.size()), argv.data());
    return terminal.Read();
  }
};

TEST_F(OnATerminal, LinesFitItsWidthAndStatesAreColoured) {
  const std::string shown = Shown({"run", "list", "device"});
  EXPECT_THAT(shown,
              AllOf(HasSubstr("\033[31mfailed"), HasSubstr("has an end")));
  const std::string plain =
      Shown({"run", "list", "device", "--color", "never"}, 80);
  EXPECT_THAT(plain, Not(HasSubstr("\033")));
  std::istringstream lines(plain);
  for (std::string line; std::getline(lines, line);) {
    EXPECT_LE(line.size(), 81u) << line;  // with the return of the terminal
  }
}

TEST_F(OnATerminal, JsonIsNeitherColouredNorShortened) {
  const std::string json =
      Shown({"run", "list", "device", "--json", "--color", "always"});
  EXPECT_THAT(json, Not(HasSubstr("\033")));
  EXPECT_THAT(json, HasSubstr(std::string(120, 'x')));
}

TEST_F(OnATerminal, APipeIsNeitherColouredNorShortened) {
  const Outcome piped = Selfcal({"run", "list", "device"});
  EXPECT_THAT(piped.out, Not(HasSubstr("\033")));
  EXPECT_THAT(piped.out, HasSubstr(std::string(120, 'x')));
  EXPECT_THAT(Selfcal({"run", "list", "device", "--color", "always"}).out,
              HasSubstr("\t\033[31mfailed\033[0m\t"));
}

}  // namespace
}  // namespace selfcal::client
