#include "server/encode/calibration_filter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "selfcal/v1/calibration_service.pb.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;

CalibrationQuery ParsedVersions(const std::string& filter,
                                const std::string& order = "") {
  CalibrationQuery query;
  const absl::Status filtered = ParseCalibrationFilter(filter, &query);
  EXPECT_TRUE(filtered.ok()) << filter << ": " << filtered;
  const absl::Status ordered = ParseCalibrationOrder(order, &query);
  EXPECT_TRUE(ordered.ok()) << order << ": " << ordered;
  return query;
}

std::string VersionFilterError(const std::string& filter) {
  CalibrationQuery query;
  const absl::Status status = ParseCalibrationFilter(filter, &query);
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << filter << ": " << status;
  return std::string(status.message());
}

std::string VersionOrderError(const std::string& order) {
  CalibrationQuery query;
  const absl::Status status = ParseCalibrationOrder(order, &query);
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << order << ": " << status;
  return std::string(status.message());
}

TEST(CalibrationFilter, ConditionsAddUp) {
  EXPECT_EQ(ParsedVersions(""), CalibrationQuery());
  const CalibrationQuery query = ParsedVersions(
      "state = ROLLED_BACK AND verdict = NOT_TRUSTWORTHY AND "
      "create_time >= 2026-11-21T04:10:03Z AND temperature_c < 30 AND "
      "temperature_c >= -2.5");
  EXPECT_EQ(query.state, CalibrationState::kRolledBack);
  EXPECT_EQ(query.verdict, VerdictKind::kNotTrustworthy);
  EXPECT_EQ(query.create_time_ns,
            (Range<std::int64_t>{1'795'234'203'000'000'000, {}}));
  EXPECT_EQ(query.temperature_c.least, -2.5);
  EXPECT_LT(query.temperature_c.most, 30);
}

// The words are those of the contract, with its numbers.
TEST(CalibrationFilter, EveryStateAndVerdictOfTheContractHasAWord) {
  const auto* states = v1::Calibration::State_descriptor();
  for (int k = 0; k < states->value_count(); ++k) {
    const int number = states->value(k)->number();
    if (number == 0) continue;
    const auto query =
        ParsedVersions("state = " + std::string(states->value(k)->name()));
    EXPECT_EQ(static_cast<int>(*query.state), number);
  }
  const auto* kinds = v1::Verdict::Kind_descriptor();
  for (int k = 0; k < kinds->value_count(); ++k) {
    const auto query =
        ParsedVersions("verdict = " + std::string(kinds->value(k)->name()));
    EXPECT_EQ(static_cast<int>(*query.verdict), kinds->value(k)->number());
  }
}

TEST(CalibrationFilter, AnOrderIsAFieldAndADirection) {
  using Order = CalibrationQuery::Order;
  EXPECT_EQ(ParsedVersions("", "temperature_c").order, Order::kTemperature);
  EXPECT_TRUE(ParsedVersions("", "temperature_c").descending);
  EXPECT_FALSE(ParsedVersions("", "temperature_c asc").descending);
  EXPECT_EQ(ParsedVersions("", "create_time desc"), CalibrationQuery());
  EXPECT_THAT(VersionOrderError("verdict"),
              HasSubstr("create_time or temperature_c"));
  EXPECT_THAT(VersionOrderError("create_time up"), HasSubstr("asc or desc"));
}

TEST(CalibrationFilter, AFaultIsNamed) {
  EXPECT_THAT(VersionFilterError("colour = red"), HasSubstr("'colour' is not"));
  EXPECT_THAT(VersionFilterError("state = active"),
              HasSubstr("ACTIVE, SUPERSEDED"));
  EXPECT_THAT(VersionFilterError("state < ACTIVE"), HasSubstr("has no order"));
  EXPECT_THAT(VersionFilterError("verdict = BAD"),
              HasSubstr("FACTORY or UNKNOWN"));
  EXPECT_THAT(VersionFilterError("temperature_c > warm"),
              HasSubstr("a number"));
  EXPECT_THAT(VersionFilterError("create_time > yesterday"),
              HasSubstr("2026-11-21T"));
}

}  // namespace
}  // namespace selfcal::server
