#include "client/selfcal/encoded_segment.h"

#include <gtest/gtest.h>

#include "test/client/selfcal/test_segments.h"

namespace selfcal::client {
namespace {

TEST(EncodedSegment, ContainsTheSegmentWithItsRig) {
  const auto result = Encode("device", Segment(7));
  const auto* encoded = std::get_if<EncodedSegment>(&result);
  ASSERT_NE(encoded, nullptr);
  EXPECT_EQ(encoded->key, (SegmentKey{"walk", 7}));
  EXPECT_FALSE(encoded->on_disk);
  EXPECT_EQ(encoded->request->parent(), "rigs/device");
  EXPECT_EQ(KeyOf(*encoded->request), (SegmentKey{"walk", 7}));
  EXPECT_EQ(encoded->request->segment().keyframes().t_ns_size(), 3);
}

TEST(EncodedSegment, IsAssembledFirstIfItIsNot) {
  ClosedSegment closed;
  closed.key = {"walk", 3};
  closed.min_observations = 2;
  closed.keyframes.resize(2);
  for (ObservedKeyframe& keyframe : closed.keyframes) {
    keyframe.observations.push_back({0, 11, {5, 5}, {0, 0, 1}});
  }
  closed.keyframes[0].observations.push_back({0, 12});  // too few of these
  const auto result = Encode("device", std::move(closed));
  const auto* encoded = std::get_if<EncodedSegment>(&result);
  ASSERT_NE(encoded, nullptr);
  EXPECT_EQ(encoded->key.index, 3);
  EXPECT_EQ(encoded->request->segment().keyframes().t_ns_size(), 2);
  EXPECT_EQ(encoded->request->segment().landmarks().id_size(), 1);
}

TEST(EncodedSegment, CountsTheTracksThatItsAssemblyDropped) {
  ClosedSegment closed;
  closed.min_observations = 2;
  closed.keyframes.resize(2);
  for (ObservedKeyframe& keyframe : closed.keyframes) {
    keyframe.observations.push_back({0, 11, {5, 5}});
  }
  AssemblyStatistics counts;
  const auto result = Encode("device", std::move(closed), &counts);
  EXPECT_TRUE(std::holds_alternative<EncodedSegment>(result));
  EXPECT_EQ(counts.tracks_triangulated, 0u);
  EXPECT_EQ(counts.tracks_dropped, 1u);
}

TEST(EncodedSegment, IsARejectionIfNoMessageCanContainIt) {
  const auto result = Encode("device", Segment(1, "not\xff utf-8"));
  const auto* rejection = std::get_if<Acknowledgement>(&result);
  ASSERT_NE(rejection, nullptr);
  EXPECT_EQ(rejection->key.index, 1);
  EXPECT_EQ(rejection->verdict, Acknowledgement::Verdict::kRejected);
  ASSERT_EQ(rejection->violations.size(), 1u);
  EXPECT_EQ(rejection->violations[0].field, "session");
}

}  // namespace
}  // namespace selfcal::client
