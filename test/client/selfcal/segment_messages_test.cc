#include "client/selfcal/segment_messages.h"

#include <gtest/gtest.h>

namespace selfcal::client {
namespace {

TEST(SegmentMessages, AnAcknowledgementHasTheNumberOfDroppedObservations) {
  v1::StreamSegmentsResponse response;
  response.set_session("walk");
  response.set_index(4);
  response.set_verdict(v1::StreamSegmentsResponse::STORED);
  EXPECT_EQ(ToAcknowledgement(response).observations_dropped, 0u);
  response.set_observations_dropped(6);
  EXPECT_EQ(ToAcknowledgement(response).observations_dropped, 6u);
  EXPECT_EQ(ToAcknowledgement(response).key, (SegmentKey{"walk", 4}));
  response.set_observations_dropped(-1);
  EXPECT_EQ(ToAcknowledgement(response).observations_dropped, 0u);
}

TEST(SegmentMessages, AnAcknowledgementHasTheNumberOfDroppedReadings) {
  v1::StreamSegmentsResponse response;
  response.set_verdict(v1::StreamSegmentsResponse::STORED);
  EXPECT_EQ(ToAcknowledgement(response).readings_dropped, 0u);
  response.set_readings_dropped(5);
  EXPECT_EQ(ToAcknowledgement(response).readings_dropped, 5u);
  EXPECT_EQ(ToAcknowledgement(response).observations_dropped, 0u);
  response.set_readings_dropped(-1);
  EXPECT_EQ(ToAcknowledgement(response).readings_dropped, 0u);
}

}  // namespace
}  // namespace selfcal::client
