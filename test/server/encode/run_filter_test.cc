#include "server/encode/run_filter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "selfcal/v1/recalibration.pb.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;

RunQuery ParsedRuns(const std::string& filter, const std::string& order = "") {
  RunQuery query;
  const absl::Status filtered = ParseRunFilter(filter, &query);
  EXPECT_TRUE(filtered.ok()) << filter << ": " << filtered;
  const absl::Status ordered = ParseRunOrder(order, &query);
  EXPECT_TRUE(ordered.ok()) << order << ": " << ordered;
  return query;
}

std::string RunFilterError(const std::string& filter) {
  RunQuery query;
  const absl::Status status = ParseRunFilter(filter, &query);
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << filter << ": " << status;
  return std::string(status.message());
}

TEST(RunFilter, ConditionsAddUp) {
  EXPECT_EQ(ParsedRuns(""), RunQuery());
  const RunQuery query = ParsedRuns(
      "state = FAILED AND trigger = SESSION_ENDED AND "
      "create_time <= 2026-11-21T04:10:03Z");
  EXPECT_EQ(query.state, RunState::kFailed);
  EXPECT_EQ(query.trigger, RunTrigger::kSessionEnded);
  EXPECT_EQ(query.create_time_ns,
            (Range<std::int64_t>{{}, 1'795'234'203'000'000'000}));
}

// The words are those of the contract, with its numbers.
TEST(RunFilter, EveryStateAndTriggerOfTheContractHasAWord) {
  const auto* states = v1::Recalibration::State_descriptor();
  for (int k = 0; k < states->value_count(); ++k) {
    const int number = states->value(k)->number();
    if (number == 0) continue;
    const auto query =
        ParsedRuns("state = " + std::string(states->value(k)->name()));
    EXPECT_EQ(static_cast<int>(*query.state), number);
  }
  const auto* triggers = v1::Recalibration::Trigger_descriptor();
  for (int k = 0; k < triggers->value_count(); ++k) {
    const int number = triggers->value(k)->number();
    if (number == 0) continue;
    const auto query =
        ParsedRuns("trigger = " + std::string(triggers->value(k)->name()));
    EXPECT_EQ(static_cast<int>(*query.trigger), number);
  }
}

TEST(RunFilter, AnOrderIsAFieldAndADirection) {
  EXPECT_EQ(ParsedRuns("", "duration asc").order, RunQuery::Order::kDuration);
  EXPECT_FALSE(ParsedRuns("", "duration asc").descending);
  EXPECT_EQ(ParsedRuns("", "create_time"), RunQuery());
  RunQuery query;
  EXPECT_THAT(std::string(ParseRunOrder("state", &query).message()),
              HasSubstr("create_time or duration"));
}

TEST(RunFilter, AFaultIsNamed) {
  EXPECT_THAT(RunFilterError("message = x"), HasSubstr("'message' is not"));
  EXPECT_THAT(RunFilterError("state = failed"), HasSubstr("FAILED or CANC"));
  EXPECT_THAT(RunFilterError("trigger > MANUAL"), HasSubstr("has no order"));
}

}  // namespace
}  // namespace selfcal::server
