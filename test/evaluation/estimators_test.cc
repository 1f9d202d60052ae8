#include "test/evaluation/estimators.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

// Scores of segments whose information about every component is so large.
std::vector<SegmentInformation> Scores(const Rig& rig,
                                       const std::vector<double>& information) {
  std::vector<SegmentInformation> scores;
  for (const double one : information) {
    const Eigen::VectorXd prior = PriorSigmas(rig);
    SegmentInformation score;
    score.Lambda =
        (one * prior.array().square().inverse()).matrix().asDiagonal();
    score.groups = ScoreGroups(rig, score.Lambda);
    scores.push_back(score);
  }
  return scores;
}

class EstimatorsTest : public ::testing::Test {
 protected:
  EstimatorsTest() { rig_.table_size = 2; }
  Rig rig_ = HandheldRig("simulated");
};

TEST_F(EstimatorsTest, MostAndLeastAreTheEndsOfTheOrder) {
  const auto scores = Scores(rig_, {10, 1000, 20, 500, 0.001});
  EXPECT_EQ(MostInformative(rig_, scores), (SegmentSet{1, 3}));
  EXPECT_EQ(SingleGroup(rig_, 3, scores), (SegmentSet{1, 2, 3}));
  // The last gains nothing, and enters no table.
  EXPECT_EQ(LeastInformative(rig_, scores), (SegmentSet{0, 2}));
  EXPECT_EQ(LeastOfSingleGroup(rig_, 1, scores), (SegmentSet{0}));
}

TEST_F(EstimatorsTest, ATableForEachGroupKeepsItsOwnBest) {
  auto scores = Scores(rig_, {100, 100, 100, 100});
  // Segment 0 says more about the IMU, 3 about the camera; ties go to the
  // older.
  const Eigen::Index size = scores[0].Lambda.rows();
  scores[0].Lambda.topLeftCorner(15, 15) *= 9;
  scores[3].Lambda.bottomRightCorner(size - 15, size - 15) *= 9;
  for (auto& score : scores) score.groups = ScoreGroups(rig_, score.Lambda);
  rig_.table_size = 1;
  EXPECT_EQ(MostInformative(rig_, scores), (SegmentSet{0, 3}));
}

TEST_F(EstimatorsTest, RandomSetsAreReproducibleAndDiffer) {
  const auto scores = Scores(rig_, std::vector<double>(45, 100));
  const SegmentSet set = RandomSegments(rig_, 8, 1, scores);
  EXPECT_EQ(set.size(), 8u);
  EXPECT_TRUE(std::is_sorted(set.begin(), set.end()));
  EXPECT_EQ(set, RandomSegments(rig_, 8, 1, scores));
  EXPECT_NE(set, RandomSegments(rig_, 8, 2, scores));
}

}  // namespace
}  // namespace selfcal
