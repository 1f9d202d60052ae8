#include "server/encode/segment_filter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "selfcal/v1/segment.pb.h"
#include "server/encode/encode.h"
#include "server/store/store.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;

SegmentQuery Parsed(const std::string& filter) {
  SegmentQuery query;
  const absl::Status status = ParseSegmentFilter(filter, &query);
  EXPECT_TRUE(status.ok()) << filter << ": " << status;
  return query;
}

std::string Error(const std::string& filter) {
  SegmentQuery query;
  const absl::Status status = ParseSegmentFilter(filter, &query);
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << filter << ": " << status;
  return std::string(status.message());
}

TEST(SegmentFilter, NothingAsksForAll) {
  EXPECT_EQ(Parsed(""), SegmentQuery());
  EXPECT_EQ(Parsed("  "), SegmentQuery());
}

TEST(SegmentFilter, ConditionsAddUp) {
  const SegmentQuery query = Parsed(
      "state = SCORED AND session=\"a \\\"b\\\" AND c\" AND has_data = false "
      "AND in_table = camera AND landmarks > 10 AND landmarks<=20 AND "
      "observations >= 7 AND calibration_version = 3 AND temperature_c >= -2.5 "
      "AND gain.imu >= 2 AND entropy.imu <= -30.5 AND angular_rate >= 0.5 AND "
      "acceleration <= 9.5 AND excluded = DOES_NOT_FIT");
  EXPECT_EQ(query.state, SegmentState::kScored);
  EXPECT_EQ(query.session, "a \"b\" AND c");
  EXPECT_EQ(query.has_data, false);
  EXPECT_EQ(query.in_table, "camera");
  EXPECT_EQ(query.landmarks, (Range<std::int64_t>{11, 20}));
  EXPECT_EQ(query.observations, (Range<std::int64_t>{7, {}}));
  EXPECT_EQ(query.calibration_version, (Range<std::int64_t>{3, 3}));
  EXPECT_EQ(query.temperature_c, (Range<double>{-2.5, {}}));
  EXPECT_EQ(query.angular_rate_radps, (Range<double>{0.5, {}}));
  EXPECT_EQ(query.acceleration_mps2, (Range<double>{{}, 9.5}));
  EXPECT_EQ(query.excluded, ExclusionCause::kDoesNotFit);
  EXPECT_EQ(query.scored_group, "imu");
  EXPECT_EQ(query.gain_nats, (Range<double>{2, {}}));
  EXPECT_EQ(query.entropy_nats, (Range<double>{{}, -30.5}));
}

TEST(SegmentFilter, TheNarrowerOfTwoConditionsHolds) {
  EXPECT_EQ(Parsed("landmarks >= 3 AND landmarks >= 5 AND landmarks < 9 AND "
                   "landmarks <= 12")
                .landmarks,
            (Range<std::int64_t>{5, 8}));
}

TEST(SegmentFilter, AnOpenEndLeavesTheNumberItselfOut) {
  const auto range = Parsed("temperature_c < 20 AND temperature_c > 10");
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(range.temperature_c.most, std::nextafter(20, -kInfinity));
  EXPECT_EQ(range.temperature_c.least, std::nextafter(10, kInfinity));
  EXPECT_EQ(Parsed("landmarks > 9223372036854775807").landmarks.least,
            INT64_MAX);
}

TEST(SegmentFilter, TimesAreRfc3339) {
  EXPECT_EQ(
      Parsed("receive_time >= 2026-11-21T04:10:03.5Z").receive_time_ns.least,
      1'795'234'203'500'000'000);
  EXPECT_EQ(
      Parsed("receive_time = 2026-11-21T05:10:03+01:00").receive_time_ns.most,
      1'795'234'203'000'000'000);
  EXPECT_THAT(Error("receive_time > yesterday"), HasSubstr("2026-11-21T"));
  EXPECT_THAT(Error("receive_time > 0001-01-01T00:00:00Z"), HasSubstr("1970"));
  EXPECT_THAT(Error("receive_time > 9999-01-01T00:00:00Z"), HasSubstr("2262"));
}

TEST(SegmentFilter, CausesAreThoseOfExclusions) {
  for (int k = v1::TableExclusion::CAUSE_UNSPECIFIED + 1;
       k < v1::TableExclusion::Cause_ARRAYSIZE;
       ++k) {
    const std::string name = v1::TableExclusion::Cause_Name(k);
    Exclusion exclusion;
    exclusion.cause = Parsed("excluded = " + name).excluded.value();
    EXPECT_EQ(v1::TableExclusion::Cause_Name(Encode("a", exclusion).cause()),
              name);
  }
  EXPECT_THAT(Error("excluded = CAUSE_UNSPECIFIED"),
              HasSubstr("a cause: INSUFFICIENT_GAIN, OUTRANKED, "));
  EXPECT_THAT(Error("excluded = 8"), HasSubstr("a cause: "));
  EXPECT_THAT(Error("excluded > OUTRANKED"), HasSubstr("has no order"));
}

TEST(SegmentFilter, MistakesAreNamed) {
  EXPECT_THAT(Error("colour = red"), HasSubstr("'colour' is not a field"));
  EXPECT_THAT(Error("state.x = SCORED"), HasSubstr("not a field"));
  EXPECT_THAT(Error("state = scored"), HasSubstr("STORED, SCORED or"));
  EXPECT_THAT(Error("state < SCORED"), HasSubstr("has no order"));
  EXPECT_THAT(Error("has_data = 1"), HasSubstr("true or false"));
  EXPECT_THAT(Error("landmarks = 3.5"), HasSubstr("a whole number"));
  EXPECT_THAT(Error("landmarks = 99999999999999999999"),
              HasSubstr("a whole number"));
  EXPECT_THAT(Error("temperature_c > nan"), HasSubstr("a number"));
  EXPECT_THAT(Error("temperature_c > 1e999"), HasSubstr("a number"));
  EXPECT_THAT(Error("angular_rate > fast"), HasSubstr("a number"));
  EXPECT_THAT(Error("gain > 3"), HasSubstr("name the group, as gain.camera"));
  EXPECT_THAT(Error("gain.imu > 3 AND entropy.camera < 2"),
              HasSubstr("imu and camera"));
  EXPECT_THAT(Error("landmarks 3"), HasSubstr("one of = < <= > >="));
  EXPECT_THAT(Error("landmarks >"), HasSubstr("'the end' is not a value"));
  EXPECT_THAT(Error("landmarks > 3 landmarks < 5"), HasSubstr("is not AND"));
  EXPECT_THAT(Error("landmarks > 3 AND"), HasSubstr("not a condition"));
  EXPECT_THAT(Error("session = \"open"), HasSubstr("closed by a quote"));
  EXPECT_THAT(Error("(state = SCORED)"), HasSubstr("not a field"));
  EXPECT_THAT(Error(std::string(5000, 'x')), HasSubstr("longer than 4000"));
}

TEST(SegmentOrder, IsAFieldAndAWay) {
  using Order = SegmentQuery::Order;
  SegmentQuery query;
  ASSERT_TRUE(ParseSegmentOrder("", &query).ok());
  EXPECT_EQ(query, SegmentQuery());
  ASSERT_TRUE(ParseSegmentOrder("entropy.camera asc", &query).ok());
  EXPECT_EQ(query.order, Order::kEntropy);
  EXPECT_EQ(query.order_group, "camera");
  EXPECT_FALSE(query.descending);
  ASSERT_TRUE(ParseSegmentOrder("angular_rate", &query).ok());
  EXPECT_EQ(query.order, Order::kAngularRate);
  ASSERT_TRUE(ParseSegmentOrder("acceleration asc", &query).ok());
  EXPECT_EQ(query.order, Order::kAcceleration);
  ASSERT_TRUE(ParseSegmentOrder("landmarks", &query).ok());
  EXPECT_EQ(query.order, Order::kLandmarks);
  EXPECT_TRUE(query.descending);
  for (const char* const wrong :
       {"entropy", "session", "landmarks up", "landmarks asc desc", "asc"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(ParseSegmentOrder(wrong, &query)))
        << wrong;
  }
}

}  // namespace
}  // namespace selfcal::server
