#include "core/selection/shared_landmarks.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>

#include "test/core/selection/random_candidates.h"

namespace selfcal {
namespace {

// Tolerance of an allocation.
constexpr double kGap_nats = 0.005;

double HalfLogDet(const Eigen::MatrixXd& matrix) {
  return 0.5 * std::log(matrix.determinant());
}

std::vector<const Candidate*> Pointers(const std::vector<Candidate>& all) {
  std::vector<const Candidate*> pointers;
  for (const Candidate& candidate : all) pointers.push_back(&candidate);
  return pointers;
}

std::vector<int> FirstOf(int count) {
  std::vector<int> members;
  for (int i = 0; i < count; ++i) members.push_back(i);
  return members;
}

Eigen::MatrixXd InformationOf(const std::vector<Candidate>& set) {
  return SharedLandmarks(Pointers(set))
      .Information(FirstOf(static_cast<int>(set.size())));
}

TEST(SharedLandmarks, SegmentsThatShareNothingAdd) {
  std::mt19937 random(1);
  std::vector<Candidate> set;
  Eigen::MatrixXd sum = Eigen::MatrixXd::Identity(5, 5);
  for (int i = 0; i < 4; ++i) {
    set.push_back(MakeTestCandidate(i,
                                    RandomInformation(5, 3, 4, &random),
                                    SketchOf(Range(100 * i, 100 * i + 80))));
    sum += set.back().information;
  }
  EXPECT_TRUE(InformationOf(set).isApprox(sum, 1e-12));
  EXPECT_TRUE(SharedLandmarks(Pointers(set)).Sum(FirstOf(4)).isApprox(sum));
}

TEST(SharedLandmarks, TheSameIdsInAnotherSessionAreOtherLandmarks) {
  std::mt19937 random(2);
  std::vector<Candidate> set;
  Eigen::MatrixXd sum = Eigen::MatrixXd::Identity(5, 5);
  for (int i = 0; i < 3; ++i) {
    set.push_back(MakeTestCandidate(
        0, RandomInformation(5, 5, 4, &random), SketchOf(Range(0, 80))));
    set.back().key.session += std::to_string(i);
    sum += set.back().information;
  }
  EXPECT_TRUE(InformationOf(set).isApprox(sum, 1e-12));
}

TEST(SharedLandmarks, CopiesAddNothing) {
  std::mt19937 random(3);
  for (const int landmarks : {1, 40, 3 * kLandmarkSketchSize}) {
    std::vector<Candidate> set;
    const Candidate one = MakeTestCandidate(0,
                                            RandomInformation(6, 6, 4, &random),
                                            SketchOf(Range(7, 7 + landmarks)));
    for (int i = 0; i < 5; ++i) {
      set.push_back(one);
      set.back().key.index = i;
      EXPECT_TRUE(InformationOf(set).isApprox(InformationOf({one}), 1e-12));
    }
  }
}

TEST(SharedLandmarks, MoreInCommonHasLessInformation) {
  std::mt19937 random(4);
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::MatrixXd a = RandomInformation(6, 4, 4, &random);
    const Eigen::MatrixXd b = RandomInformation(6, 4, 4, &random);
    double last = HalfLogDet(Eigen::MatrixXd::Identity(6, 6) + a + b) + 1e-9;
    for (int common = 0; common <= 100; common += 20) {
      const std::vector<Candidate> set = {
          MakeTestCandidate(0, a, SketchOf(Range(0, 100))),
          MakeTestCandidate(1, b, SketchOf(Range(100 - common, 200 - common)))};
      const double value = HalfLogDet(InformationOf(set));
      EXPECT_LE(value, last + kGap_nats);
      EXPECT_GE(value, HalfLogDet(InformationOf({set[0]})) - kGap_nats);
      EXPECT_GE(value, HalfLogDet(InformationOf({set[1]})) - kGap_nats);
      last = value;
    }
  }
}

TEST(SharedLandmarks, OneMoreSegmentNeverReducesInformation) {
  std::mt19937 random(5);
  std::uniform_int_distribution<std::uint64_t> first(0, 300);
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<Candidate> set;
    double last = 0;
    for (int i = 0; i < 8; ++i) {
      const std::uint64_t begin = first(random);
      set.push_back(
          MakeTestCandidate(i,
                            RandomInformation(6, 1 + i % 6, i + 1, &random),
                            SketchOf(Range(begin, begin + 150), 1 + i)));
      const double value = HalfLogDet(InformationOf(set));
      EXPECT_GE(value, last - kGap_nats);
      last = value;
    }
  }
}

// Two with the same landmarks: I + w A + (1 - w) B with the best w.
TEST(SharedLandmarks, IsCovarianceIntersectionForTwoWithTheSameLandmarks) {
  std::mt19937 random(6);
  for (int trial = 0; trial < 50; ++trial) {
    const std::vector<Candidate> set = {
        MakeTestCandidate(0,
                          RandomInformation(4, 1 + trial % 4, 3, &random),
                          SketchOf(Range(0, 60))),
        MakeTestCandidate(
            1, RandomInformation(4, 2, 2, &random), SketchOf(Range(0, 60)))};
    double best = 0;
    for (double w = 0; w <= 1; w += 0.001) {
      best = std::max(
          best,
          HalfLogDet(Eigen::MatrixXd::Identity(4, 4) + w * set[0].information +
                     (1 - w) * set[1].information));
    }
    EXPECT_NEAR(HalfLogDet(InformationOf(set)), best, kGap_nats);
  }
}

TEST(SharedLandmarks, DoesNotDependOnTheOrder) {
  std::mt19937 random(7);
  std::vector<Candidate> set;
  for (int i = 0; i < 6; ++i) {
    set.push_back(MakeTestCandidate(i,
                                    RandomInformation(5, 3, 4, &random),
                                    SketchOf(Range(30 * i, 30 * i + 100))));
  }
  const Eigen::MatrixXd expected = InformationOf(set);
  for (int trial = 0; trial < 10; ++trial) {
    std::shuffle(set.begin(), set.end(), random);
    EXPECT_TRUE(InformationOf(set).isApprox(expected, 1e-10));
  }
}

// Segments too large for their sketches: the share is that of the sample.
TEST(SharedLandmarks, LargeSegmentsAreComparedByTheirSketches) {
  const Eigen::MatrixXd one = 100 * Eigen::MatrixXd::Identity(3, 3);
  const std::vector<Candidate> set = {
      MakeTestCandidate(0, one, SketchOf(Range(0, 20000))),
      MakeTestCandidate(1, one, SketchOf(Range(15000, 35000)))};
  // A quarter of each is common, and counts once: 2 - 1/4 of one.
  const double counted = (InformationOf(set)(0, 0) - 1) / 100;
  EXPECT_NEAR(counted, 1.75, 0.1);
  EXPECT_NE(counted, 1.75);
}

}  // namespace
}  // namespace selfcal
