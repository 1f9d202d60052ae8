#include "client/selfcal/incoming_segments.h"

#include <gtest/gtest.h>

#include "test/client/selfcal/test_segments.h"

namespace selfcal::client {
namespace {

std::int64_t IndexOf(const UnencodedSegment& segment) {
  return std::get<MotionSegment>(segment).key.index;
}

TEST(IncomingSegments, HandsOutInOrderAndCountsWhatIsHandedOut) {
  IncomingSegments incoming(4);
  EXPECT_FALSE(incoming.Take().has_value());
  EXPECT_EQ(incoming.size(), 0u);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(incoming.Push(Segment(i), 0));
  for (int i = 0; i < 3; ++i) {
    const auto taken = incoming.Take();
    ASSERT_TRUE(taken.has_value());
    EXPECT_EQ(IndexOf(*taken), i);
    EXPECT_EQ(incoming.waiting(), static_cast<std::size_t>(2 - i));
    EXPECT_EQ(incoming.size(), static_cast<std::size_t>(3 - i));
    incoming.Release();
    EXPECT_EQ(incoming.size(), static_cast<std::size_t>(2 - i));
  }
}

TEST(IncomingSegments, AcceptsNoMoreThanThereIsRoomForWithThoseElsewhere) {
  constexpr std::size_t kRoom = 5;
  for (std::size_t elsewhere = 0; elsewhere <= kRoom; ++elsewhere) {
    IncomingSegments incoming(kRoom);
    std::size_t accepted = 0;
    while (incoming.Push(Segment(0), elsewhere)) ++accepted;
    EXPECT_EQ(accepted, kRoom - elsewhere);
    if (accepted == 0) continue;
    ASSERT_TRUE(incoming.Take().has_value());
    EXPECT_FALSE(incoming.Push(Segment(0), elsewhere)) << "is still in memory";
    incoming.Release();
    EXPECT_TRUE(incoming.Push(Segment(0), elsewhere));
  }
}

TEST(IncomingSegments, LeavesARefusedSegmentAsItIs) {
  IncomingSegments incoming(1);
  ASSERT_TRUE(incoming.Push(Segment(0), 0));
  UnencodedSegment refused = Segment(1);
  EXPECT_FALSE(incoming.Push(std::move(refused), 0));
  // NOLINTNEXTLINE(bugprone-use-after-move): what remains is the contract.
  EXPECT_EQ(std::get<MotionSegment>(refused).imu.size(), 100u);
}

}  // namespace
}  // namespace selfcal::client
