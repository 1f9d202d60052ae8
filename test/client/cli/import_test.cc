// selfcal segment import.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>
#include <string>

#include "test/client/cli/commands_fixture.h"
#include "test/recordings.h"

namespace selfcal::client {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class ImportCommand : public Commands {
 protected:
  ImportCommand() { daemon_.rigs.push_back(ToProto(ARig("device"))); }
};

TEST_F(ImportCommand, SendsEverySegmentOfARecording) {
  SELFCAL_NEED_RECORDING(map, "tango_handheld");
  const Outcome outcome =
      Selfcal({"import", "device", map, "--session", "walk"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  std::string expected;
  for (int i = 0; i < 14; ++i) {
    expected += "walk\t" + std::to_string(i) + "\tSTORED\n";
  }
  EXPECT_EQ(outcome.out, expected);
}

TEST_F(ImportCommand, TellsTheTemperatureIfItIsKnown) {
  SELFCAL_NEED_RECORDING(map, "tango_handheld");
  EXPECT_EQ(Selfcal({"import", "device", map}).code, 0);
  EXPECT_FALSE(daemon_.last_segment.has_temperature_c());
  EXPECT_EQ(Selfcal({"import", "device", map, "--temperature", "21.5"}).code,
            0);
  EXPECT_EQ(daemon_.last_segment.temperature_c(), 21.5);
  const Outcome kelvin =
      Selfcal({"import", "device", map, "--temperature", "294"});
  EXPECT_EQ(kelvin.code, 2);
  EXPECT_THAT(kelvin.err, HasSubstr("--temperature"));
}

TEST_F(ImportCommand, ReportsARejectionAndExitsWithOne) {
  SELFCAL_NEED_RECORDING(map, "tango_handheld");
  daemon_.reject_index = 2;
  const Outcome outcome = Selfcal({"import", "device", map, "--json"});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("\n  keyframes[3].q_gi: norm is 0.9\n"));
  std::istringstream lines(outcome.out);
  std::string line;
  for (int i = 0; i < 14; ++i) {
    ASSERT_TRUE(std::getline(lines, line));
    const auto response = Parse<v1::StreamSegmentsResponse>(line);
    EXPECT_EQ(response.index(), i);
    EXPECT_EQ(response.verdict(),
              i == 2 ? v1::StreamSegmentsResponse::REJECTED
                     : v1::StreamSegmentsResponse::STORED);
  }
}

TEST_F(ImportCommand, OfManyRejectionsAScreenIsShownAndTheirNumber) {
  SELFCAL_NEED_RECORDING(map, "tango_handheld");
  daemon_.reject_all = true;
  const Outcome outcome = Selfcal({"segment", "import", "device", map});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 22)
      << "with a warning about the data";
  EXPECT_THAT(outcome.err,
              HasSubstr("and 4 more segments were rejected: 14 in all\n"));
}

TEST_F(ImportCommand, NamesTheReasonOfTheDaemonAndExitsWithOneIfItRefuses) {
  SELFCAL_NEED_RECORDING(map, "tango_handheld");
  daemon_.stream_refusal = {
      grpc::StatusCode::RESOURCE_EXHAUSTED,
      "the database holds 95 of at most 100 bytes: raise max-database-bytes"};
  const Outcome outcome =
      Selfcal({"segment", "import", "device", map, "--timeout", "1"});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_EQ(outcome.out, "");
  EXPECT_THAT(outcome.err,
              HasSubstr("selfcal: 14 segments are not acknowledged: "
                        "RESOURCE_EXHAUSTED: the database holds 95 of at most "
                        "100 bytes: raise max-database-bytes\n"));
  EXPECT_THAT(outcome.err, Not(HasSubstr("Is selfcald running?")));
}

TEST_F(ImportCommand, ExitsWithThreeIfTheDaemonIsUnavailable) {
  SELFCAL_NEED_RECORDING(map, "tango_handheld");
  daemon_.stream_refusal = {grpc::StatusCode::UNAVAILABLE,
                            "the daemon is stopping"};
  const Outcome outcome =
      Selfcal({"segment", "import", "device", map, "--timeout", "1"});
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(
      outcome.err,
      AllOf(HasSubstr("does not answer"), HasSubstr("the daemon is stopping")));
}

TEST_F(ImportCommand, ExitsWithOneForARigThatDoesNotExist) {
  SELFCAL_NEED_RECORDING(map, "tango_handheld");
  const Outcome outcome = Selfcal({"import", "nobody", map});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_EQ(outcome.out, "");
  EXPECT_THAT(outcome.err, HasSubstr("rigs/nobody does not exist"));
}

}  // namespace
}  // namespace selfcal::client
