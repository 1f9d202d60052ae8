// What the command line answers to mistakes, and which words it knows.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include "client/cli/old_spellings.h"
#include "test/client/cli/commands_fixture.h"

namespace selfcal::client {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

struct Mistake {
  std::vector<std::string> line;
  int code = 2;
  std::string answer;  // part of it
};

class Usage : public Commands {
 protected:
  // The options in a help, without what excludes them: that has no order.
  static std::string OptionsIn(const std::string& help) {
    const std::size_t begin = help.find("\nOptions:");
    EXPECT_NE(begin, help.npos) << help;
    return std::regex_replace(
        help.substr(begin), std::regex(" Excludes: [^\n]*"), "");
  }

  void ExpectAnswer(const Mistake& mistake) {
    const Outcome outcome = Selfcal(mistake.line);
    EXPECT_EQ(outcome.code, mistake.code)
        << testing::PrintToString(mistake.line);
    EXPECT_EQ(outcome.out, "");
    EXPECT_THAT(outcome.err, HasSubstr(mistake.answer));
    EXPECT_THAT(outcome.err, testing::StartsWith("selfcal: "));
  }
};

TEST_F(Usage, TheTwelveMostFrequentMistakesAreLedOn) {
  const std::string map = temp_folder_.File("");
  v1::Rig tablet = ToProto(ARig("tablet"));
  daemon_.rigs = {tablet};
  const std::vector<Mistake> mistakes = {
      {{"rigs"}, 2, "'selfcal rig' needs a command: create, list, "},
      {{"list"}, 2, "selfcal rig list"},
      {{"show", "tablet"}, 2, "selfcal rig show"},
      {{"status"}, 2, "did you mean 'selfcal daemon top'?"},
      {{"calibrate", "tablet"}, 2, "`selfcal run start RIG`"},
      {{"rig", "ls"}, 2, "did you mean 'selfcal rig list'?"},
      {{"segment", "import", map, "tablet"}, 2, "the rig comes first"},
      {{"rig", "create"}, 2, "FILE, --from FORMAT FILE... or --vi-map DIR"},
      {{"rig", "show", "tablte"}, 1, "Did you mean 'tablet'?"},
      {{"segment", "show", "tablet"}, 2, "SEGMENT is required"},
      {{"rig", "show"}, 2, "'selfcal rig list' lists the rigs"},
      {{"rig", "list", "--limt", "3"}, 2, "did you mean '--limit'?"}};
  ASSERT_EQ(mistakes.size(), 12u);
  for (const Mistake& mistake : mistakes) ExpectAnswer(mistake);
}

TEST_F(Usage, HelpAndVersionHaveTheUsualSpellings) {
  for (const char* word : {"--version", "-V", "-v", "version"}) {
    const Outcome outcome = Selfcal({word});
    EXPECT_EQ(outcome.code, 0) << word;
    EXPECT_THAT(outcome.out, testing::StartsWith("selfcal ")) << outcome.err;
  }
  EXPECT_THAT(Selfcal({"help"}).out, HasSubstr("calibration"));
  EXPECT_THAT(Selfcal({"help", "rig"}).out,
              AllOf(HasSubstr("selfcal rig"), HasSubstr("create")));
  EXPECT_THAT(Selfcal({"help", "rigs", "create"}).out, HasSubstr("--vi-map"));
  const Outcome unknown = Selfcal({"help", "rgi"});
  EXPECT_EQ(unknown.code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("did you mean 'selfcal rig'?"));
}

TEST_F(Usage, UnknownWordsAreNamedWithTheNearest) {
  const std::vector<Mistake> mistakes = {
      {{"segmnt", "list"},
       2,
       "'selfcal' has no command 'segmnt'; did you mean "
       "'selfcal segment'?"},
      {{"docter"}, 2, "did you mean 'selfcal daemon doctor'?"},
      {{"calibration", "activte", "a", "1"},
       2,
       "did you mean 'selfcal calibration activate'?"},
      {{"run", "stop", "a", "1"}, 2, "did you mean 'selfcal run cancel'?"},
      {{"rig", "bananas"}, 2, "Commands: create, list, "},
      {{"rig", "list", "--jsno"}, 2, "did you mean '--json'?"},
      {{"rig", "list", "--filtre=x"}, 2, "no flag '--filtre'"},
      {{"rig", "list", "more"}, 2, "'more' was not expected"},
      {{"event", "list", "--kind", "data-evictd"},
       2,
       "did you mean 'data-evicted'?"},
      {{"segment", "export", "a", "--output", "x", "--format", "cvs"},
       2,
       "did you mean 'csv'?"},
      {{"rig", "create", "x", "--from", "kalib"}, 2, "did you mean 'kalibr'?"},
      {{"completion", "zhs"}, 2, "did you mean 'zsh'?"},
      {{"rig", "list", "--color", "alwayz"}, 2, "did you mean 'always'?"}};
  for (const Mistake& mistake : mistakes) ExpectAnswer(mistake);
}

TEST_F(Usage, ANumberOutOfRangeIsAnsweredWithTheRange) {
  const std::string whole = "must be a whole number of at least 1";
  const std::vector<Mistake> mistakes = {
      {{"run", "list", "a", "--limit", "0"}, 2, "--limit: '0' " + whole},
      {{"rig", "list", "--limit", "-3"}, 2, "--limit: '-3' " + whole},
      {{"rig", "list", "--limit", "1.5"}, 2, "--limit: '1.5' " + whole},
      {{"rig", "list", "--limit", "ten"}, 2, "--limit: 'ten' " + whole},
      {{"table", "show", "a", "--limit", "0"}, 2, "--limit: '0' " + whole},
      {{"calibration", "watch", "a", "--count", "0"},
       2,
       "--count: '0' " + whole},
      {{"rig", "coach", "a", "--top", "0"}, 2, "--top: '0' " + whole},
      {{"rig", "coach", "a", "--watch", "--count", "0"},
       2,
       "--count: '0' " + whole},
      {{"segment", "residuals", "a", "s~0", "--version", "0"},
       2,
       "--version: '0' " + whole},
      {{"segment", "import", "a", "b", "--seconds", "0"},
       2,
       "--seconds: '0' must be a number greater than 0"},
      {{"segment", "import", "a", "b", "--seconds", "nan"},
       2,
       "--seconds: 'nan' must be a number greater than 0"}};
  for (const Mistake& mistake : mistakes) ExpectAnswer(mistake);
}

TEST_F(Usage, EveryOldSpellingStillWorksAndHelpShowsTheNewAlone) {
  const std::string help = Selfcal({"--help"}).out;
  for (const auto& [old, present] : OldSpellings()) {
    const Outcome outcome = Selfcal({old, "--help"});
    EXPECT_EQ(outcome.code, 0) << old;
    std::vector<std::string> words;
    std::istringstream stream(present);
    for (std::string word; stream >> word;) words.push_back(word);
    words.push_back("--help");
    const std::string now = Selfcal(words).out;
    EXPECT_EQ(OptionsIn(outcome.out), OptionsIn(now)) << old;
    EXPECT_THAT(help, Not(HasSubstr("\n  " + old + " "))) << old;
  }
  for (const std::string noun :
       {"rig", "segment", "session", "run", "calibration"}) {
    EXPECT_EQ(Selfcal({noun + "s", "list", "--help"}).out,
              Selfcal({noun, "list", "--help"}).out);
    EXPECT_THAT(help, Not(HasSubstr(noun + "s,")));
    EXPECT_THAT(help, HasSubstr("\n  " + noun + " "));
  }
  EXPECT_EQ(Selfcal({"daemons", "top", "--help"}).out,
            Selfcal({"daemon", "top", "--help"}).out);
  EXPECT_THAT(help, Not(HasSubstr("daemons")));
  EXPECT_EQ(Selfcal({"calibrations", "diff", "--help"}).out,
            Selfcal({"calibration", "compare", "--help"}).out);
}

TEST_F(Usage, OldSpellingsDoTheSame) {
  daemon_.calibrations = {Version(1)};
  daemon_.tables.add_tables()->set_name("rigs/device/tables/imu");
  daemon_.tables.mutable_tables(0)->add_entries()->set_segment("x/a~0");
  EXPECT_EQ(Selfcal({"tables", "device"}).out,
            Selfcal({"table", "show", "device"}).out);
  EXPECT_EQ(Selfcal({"calibrations", "list", "device"}).out,
            Selfcal({"calibration", "list", "device"}).out);
  EXPECT_THAT(Selfcal({"recalibrate", "device"}).err,
              Selfcal({"run", "start", "device"}).err);
}

// The table of docs/api.md.
TEST_F(Usage, ExitCodesAreThoseOfTheDocumentation) {
  daemon_.rigs = {ToProto(ARig("device"))};
  EXPECT_EQ(Selfcal({"rig", "list"}).code, 0);
  EXPECT_EQ(Selfcal({"rig", "show", "nobody"}).code, 1) << "refused";
  EXPECT_EQ(Selfcal({"run", "start", "device"}).code, 1) << "no segments";
  EXPECT_EQ(Selfcal({"rig"}).code, 2) << "usage";
  EXPECT_EQ(Selfcal({"rig", "create", "/nowhere"}).code, 2) << "input";
  EXPECT_EQ(Selfcal({"run", "list", "device", "--filter", "x = 1"}).code, 2);
  EXPECT_EQ(
      client::Selfcal({"rig", "list", "--target", "unix:/nowhere/at_all"}).code,
      3);
  daemon_.calibrations = {Version(1)};
  EXPECT_EQ(Selfcal({"calibration",
                     "report",
                     "device",
                     "--output",
                     WriteFile("precious")})
                .code,
            2)
      << "a file is in the way";
  // 4, of `daemon doctor`, is in store_test.cc.
}

TEST_F(Usage, WithoutACommandTheHelpIsOnStandardError) {
  const Outcome outcome = Selfcal({});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_EQ(outcome.out, "");
  EXPECT_THAT(outcome.err, HasSubstr("a command is missing"));
  EXPECT_THAT(outcome.err, HasSubstr("calibration"));
}

TEST_F(Usage, ErrorsOfTheDaemonNameTheFlag) {
  const std::string file = WriteFile("{}");
  daemon_.refusal = BadField("rig.name", "must be 1 to 63 characters");
  EXPECT_THAT(Selfcal({"rig", "create", file, "--id", "A b"}).err,
              HasSubstr("\n  --id: must be 1 to 63 characters\n"));
  EXPECT_THAT(Selfcal({"rig", "create", file}).err,
              HasSubstr("\n  rig.name: must be 1 to 63 characters\n"))
      << "the file has set it";
  daemon_.refusal =
      BadField("rig.imu_noise.gyro_noise_density", "is not positive");
  EXPECT_THAT(Selfcal({"rig", "create", file, "--gyro-noise", "-1"}).err,
              HasSubstr("\n  --gyro-noise: is not positive\n"));
  daemon_.refusal = BadField("rig.fixed[1]", "matches no component");
  EXPECT_THAT(
      Selfcal({"rig", "create", file, "--fixed", "a", "--fixed", "b"}).err,
      HasSubstr("\n  --fixed b: matches no component\n"));
}

TEST_F(Usage, ErrorsFillAtMostAScreen) {
  google::rpc::BadRequest request;
  for (int i = 0; i < 50; ++i) {
    auto* violation = request.add_field_violations();
    violation->set_field("rig.groups[" + std::to_string(i) + "]");
    violation->set_description("is wrong");
  }
  request.add_field_violations()->set_description(
      "and 950 more; correct these first");
  google::rpc::Status details;
  details.add_details()->PackFrom(request);
  daemon_.refusal = {grpc::StatusCode::INVALID_ARGUMENT,
                     "bad request",
                     details.SerializeAsString()};
  const Outcome outcome = Selfcal({"rig", "create", WriteFile("{}")});
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 22);
  EXPECT_THAT(outcome.err, HasSubstr("rig.groups[19]: is wrong"));
  EXPECT_THAT(outcome.err, Not(HasSubstr("rig.groups[20]")));
  EXPECT_THAT(outcome.err, HasSubstr("and 980 more: 1000 errors in all"));
}

}  // namespace
}  // namespace selfcal::client
