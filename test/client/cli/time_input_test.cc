#include "client/cli/time_input.h"

#include <google/protobuf/util/time_util.h>
#include <gtest/gtest.h>

namespace selfcal::client {
namespace {

using google::protobuf::util::TimeUtil;

// What `text` means at noon of 2026-11-21, as RFC 3339.
std::string Parsed(const std::string& text) {
  google::protobuf::Timestamp noon;
  EXPECT_TRUE(TimeUtil::FromString("2026-11-21T12:00:00Z", &noon));
  const auto time = ParseTime(text, noon);
  return time.ok() ? TimeUtil::ToString(*time)
                   : std::string(time.status().message());
}

TEST(ParseTime, TakesDatesAndTimesInUtc) {
  EXPECT_EQ(Parsed("2026-01-31"), "2026-01-31T00:00:00Z");
  EXPECT_EQ(Parsed("2026-01-31 04:10:03"), "2026-01-31T04:10:03Z");
  EXPECT_EQ(Parsed("2026-01-31T04:10:03"), "2026-01-31T04:10:03Z");
  EXPECT_EQ(Parsed("2026-01-31T04:10:03.5Z"), "2026-01-31T04:10:03.500Z");
}

TEST(ParseTime, TakesAges) {
  EXPECT_EQ(Parsed("30s"), "2026-11-21T11:59:30Z");
  EXPECT_EQ(Parsed("15m"), "2026-11-21T11:45:00Z");
  EXPECT_EQ(Parsed("2h"), "2026-11-21T10:00:00Z");
  EXPECT_EQ(Parsed("7d"), "2026-11-14T12:00:00Z");
}

TEST(ParseTime, SaysWhatToGiveInsteadOfAnythingElse) {
  for (const std::string text : {"",
                                 "s",
                                 "-2h",
                                 "2w",
                                 "2 h",
                                 "99999999999999999999d",
                                 "9000000000000000000s",
                                 "2026-02-30",
                                 "2026-11-21 25:00:00",
                                 "21.11.2026",
                                 "yesterday"}) {
    EXPECT_NE(Parsed(text).find("'" + text + "' is not a time: use"),
              std::string::npos)
        << Parsed(text);
  }
}

}  // namespace
}  // namespace selfcal::client
