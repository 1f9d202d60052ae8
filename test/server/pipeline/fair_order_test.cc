#include "server/pipeline/fair_order.h"

#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

namespace selfcal::server {
namespace {

using Piece = FairOrder::Piece;

TEST(FairOrderTest, EqualPiecesAreTakenInTurn) {
  FairOrder order;
  const std::vector<Piece> all = {{"a", 1}, {"b", 1}, {"c", 1}};
  for (const std::size_t expected : {0, 1, 2, 0, 1, 2}) {
    EXPECT_EQ(order.Take(all), expected);
  }
  EXPECT_EQ(order.Take({}), std::nullopt);
}

TEST(FairOrderTest, ASmallPieceDoesNotWaitForARoundOfLargeOnes) {
  FairOrder order;
  std::vector<Piece> large;
  for (int k = 0; k < 48; ++k) {
    large.push_back({"large" + std::to_string(k), 300});
  }
  for (int k = 0; k < 100; ++k) order.Take(large);
  std::vector<Piece> all = large;
  all.push_back({"small", 1});
  for (int k = 0; k < 10; ++k) {
    EXPECT_EQ(order.Take(all), large.size()) << "each time";
    order.Take(large);
  }
}

// Whatever the sizes of their pieces.
TEST(FairOrderTest, AllThatWaitGetTheSameShare) {
  FairOrder order;
  const std::vector<Piece> all = {{"a", 1}, {"b", 3}, {"c", 10}, {"d", 2.5}};
  std::map<std::string, double> had;
  for (int k = 0; k < 4000; ++k) {
    const Piece& taken = all[order.Take(all).value()];
    had[taken.rig] += taken.cost;
  }
  for (const Piece& piece : all) {
    EXPECT_NEAR(had[piece.rig], had["a"], 10 + piece.cost) << piece.rig;
  }
}

TEST(FairOrderTest, AbsenceGivesNoCredit) {
  FairOrder order;
  const std::vector<Piece> one = {{"busy", 1}};
  const std::vector<Piece> both = {{"busy", 1}, {"back", 1}};
  order.Take(both);
  for (int k = 0; k < 1000; ++k) order.Take(one);
  std::map<std::size_t, int> turns;
  for (int k = 0; k < 10; ++k) ++turns[order.Take(both).value()];
  EXPECT_NEAR(turns[0], turns[1], 2);
}

}  // namespace
}  // namespace selfcal::server
