#include "core/selection/joint_selection.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "test/core/selection/random_candidates.h"

namespace selfcal {
namespace {

constexpr int kSize = 6;

JointSettings Settings(Criterion criterion, int capacity) {
  JointSettings settings;
  settings.criterion = criterion;
  settings.capacity = capacity;
  settings.min_gain_nats = 0.5;
  settings.prior_in_reference = Eigen::VectorXd::Constant(kSize, 10);
  return settings;
}

// Weak and strong, of few and of all directions, some with landmarks in common.
std::vector<Candidate> RandomCandidates(int count, std::mt19937* random) {
  std::vector<Candidate> candidates;
  for (int i = 0; i < count; ++i) {
    const std::uint64_t begin = (*random)() % 400;
    candidates.push_back(MakeTestCandidate(
        i,
        RandomInformation(
            kSize, 1 + (*random)() % kSize, 0.5 + (*random)() % 5, random),
        SketchOf(Range(begin, begin + 50))));
  }
  return candidates;
}

std::vector<Candidate> Chosen(const std::vector<Candidate>& candidates,
                              const std::vector<int>& indices) {
  std::vector<Candidate> set;
  for (const int i : indices) set.push_back(candidates[i]);
  return set;
}

double ValueOf(const JointSettings& settings,
               const std::vector<Candidate>& candidates,
               const std::vector<int>& indices) {
  return JointValue(settings, Chosen(candidates, indices));
}

constexpr Criterion kAll[] = {Criterion::kD, Criterion::kA, Criterion::kE};

TEST(JointValue, IsTheSameForAllCriteriaWhereAllDirectionsAreAlike) {
  for (const double information : {1.0, 4.0, 1e6}) {
    const Eigen::MatrixXd all =
        information * Eigen::MatrixXd::Identity(kSize, kSize);
    const double nats = kSize / 2.0 * std::log(information);
    EXPECT_NEAR(JointValue(Settings(Criterion::kD, 1), all), nats, 1e-12);
    EXPECT_NEAR(JointValue(Settings(Criterion::kE, 1), all), nats, 1e-12);
    // In units of sigma_ref, a tenth of the prior.
    EXPECT_NEAR(JointValue(Settings(Criterion::kA, 1), all),
                nats - kSize * std::log(10.0),
                1e-12);
  }
}

TEST(JointValue, IsThatOfTheEigenvalues) {
  const Eigen::VectorXd eigenvalues = Eigen::VectorXd::LinSpaced(kSize, 2, 12);
  std::mt19937 random(1);
  const Eigen::MatrixXd Q = RandomInformation(kSize, kSize, 1, &random)
                                .householderQr()
                                .householderQ();
  const Eigen::MatrixXd information =
      Q * eigenvalues.asDiagonal() * Q.transpose();
  EXPECT_NEAR(JointValue(Settings(Criterion::kD, 1), information),
              0.5 * eigenvalues.array().log().sum(),
              1e-9);
  EXPECT_NEAR(JointValue(Settings(Criterion::kE, 1), information),
              kSize / 2.0 * std::log(2.0),
              1e-9);
  EXPECT_NEAR(JointValue(Settings(Criterion::kA, 1), information),
              -kSize / 2.0 * std::log(100 * eigenvalues.cwiseInverse().mean()),
              1e-9);
}

TEST(JointSelection, PrefersMissingInformationToMoreOfTheSame) {
  const JointSettings settings = Settings(Criterion::kD, 2);
  Eigen::MatrixXd strong = Eigen::MatrixXd::Zero(kSize, kSize);
  strong.topLeftCorner<3, 3>().diagonal().setConstant(100);
  Eigen::MatrixXd other = Eigen::MatrixXd::Zero(kSize, kSize);
  other.bottomRightCorner<3, 3>().diagonal().setConstant(20);
  const std::vector<Candidate> candidates = {MakeTestCandidate(0, strong),
                                             MakeTestCandidate(1, strong),
                                             MakeTestCandidate(2, other)};
  const std::vector<int> expected = {0, 2};
  EXPECT_EQ(SelectStreaming(settings, candidates), expected);
  EXPECT_EQ(SelectGreedily(settings, candidates), expected);
}

TEST(JointSelection, StaysWithinTheBoundAndNeverGetsWorse) {
  std::mt19937 random(2);
  for (const Criterion criterion : kAll) {
    for (int trial = 0; trial < 20; ++trial) {
      const JointSettings settings = Settings(criterion, 1 + trial % 5);
      std::vector<Candidate> set;
      double value = JointValue(settings, set);
      for (const Candidate& candidate : RandomCandidates(25, &random)) {
        const std::size_t before = set.size();
        const JointChange change = Offer(settings, candidate, set);
        ASSERT_EQ(
            change.evicted.has_value(),
            change.inserted && static_cast<int>(before) == settings.capacity);
        if (change.evicted) set.erase(set.begin() + *change.evicted);
        if (change.inserted) set.push_back(candidate);
        ASSERT_LE(static_cast<int>(set.size()), settings.capacity);
        const double next = JointValue(settings, set);
        if (change.evicted) {
          EXPECT_GE(next, value + 0.5 / settings.capacity);
        } else if (!change.inserted) {
          EXPECT_EQ(next, value);
        }
        value = next;
      }
    }
  }
}

// One more and one fewer: no reachable set is better.
TEST(JointSelection, ReplacesTheSegmentWithTheLeastContribution) {
  std::mt19937 random(3);
  int exchanged = 0;
  for (const Criterion criterion : kAll) {
    const JointSettings settings = Settings(criterion, 4);
    for (int trial = 0; trial < 30; ++trial) {
      const std::vector<Candidate> candidates = RandomCandidates(5, &random);
      const std::vector<Candidate> set(candidates.begin(),
                                       candidates.end() - 1);
      const JointChange change = Offer(settings, candidates.back(), set);
      double best = JointValue(settings, set) + 0.5 / settings.capacity;
      std::optional<int> expected;
      for (int out = 3; out >= 0; --out) {
        std::vector<int> rest = {0, 1, 2, 3, 4};
        rest.erase(rest.begin() + out);
        const double value = ValueOf(settings, candidates, rest);
        if (value > best) {
          best = value;
          expected = out;
        }
      }
      if (change.gain < 0.5 / settings.capacity) continue;
      EXPECT_EQ(change.evicted, expected);
      exchanged += change.inserted ? 1 : 0;
    }
  }
  EXPECT_GT(exchanged, 10);
}

TEST(JointSelection, ACopyUnderAnotherIndexDoesNotEnter) {
  std::mt19937 random(4);
  for (const Criterion criterion : kAll) {
    const JointSettings settings = Settings(criterion, 10);
    const std::vector<Candidate> candidates = RandomCandidates(6, &random);
    const std::vector<Candidate> set =
        Chosen(candidates, SelectStreaming(settings, candidates));
    ASSERT_FALSE(set.empty());
    for (Candidate copy : set) {
      copy.key.index += 100;
      copy.sequence += 100;
      const JointChange change = Offer(settings, copy, set);
      EXPECT_FALSE(change.inserted);
      EXPECT_NEAR(change.gain, 0, 0.005);
    }
  }
}

TEST(JointSelection, WithoutTheDiscountACopyCountsAgain) {
  std::mt19937 random(5);
  JointSettings settings = Settings(Criterion::kD, 2);
  Candidate one = MakeTestCandidate(
      0, RandomInformation(kSize, kSize, 5, &random), SketchOf(Range(0, 50)));
  Candidate copy = one;
  copy.key.index = 1;
  EXPECT_FALSE(Offer(settings, copy, std::vector{one}).inserted);
  settings.share_landmarks = false;
  EXPECT_TRUE(Offer(settings, copy, std::vector{one}).inserted);
}

TEST(JointSelection, TheSameKeyChangesNothing) {
  std::mt19937 random(6);
  const JointSettings settings = Settings(Criterion::kD, 5);
  const std::vector<Candidate> candidates = RandomCandidates(20, &random);
  std::vector<Candidate> twice;
  for (const Candidate& candidate : candidates) {
    twice.push_back(candidate);
    twice.push_back(candidate);
  }
  std::vector<int> expected;
  for (const int i : SelectStreaming(settings, candidates)) {
    expected.push_back(2 * i);
  }
  EXPECT_EQ(SelectStreaming(settings, twice), expected);
}

TEST(JointSelection, OfEqualOnesTheOlderStay) {
  std::mt19937 random(7);
  JointSettings settings = Settings(Criterion::kD, 2);
  settings.share_landmarks = false;
  const Candidate one =
      MakeTestCandidate(0, RandomInformation(kSize, kSize, 5, &random));
  std::vector<Candidate> candidates;
  for (int i = 0; i < 6; ++i) {
    candidates.push_back(one);
    candidates.back().key.index = i;
    candidates.back().sequence = i;
  }
  const std::vector<int> expected = {0, 1};
  EXPECT_EQ(SelectStreaming(settings, candidates), expected);
  EXPECT_EQ(SelectGreedily(settings, candidates), expected);
  // A better one takes the place of the newest.
  candidates.back().information *= 4;
  const std::vector<int> exchanged = {0, 5};
  EXPECT_EQ(SelectStreaming(settings, candidates), exchanged);
}

TEST(JointSelection, ASegmentWithInsufficientGainDoesNotEnter) {
  const JointSettings settings = Settings(Criterion::kD, 5);
  // 1/2 ln det (I + x I) = 3 ln(1 + x).
  const auto with_gain = [](int index, double nats) {
    return MakeTestCandidate(
        index,
        (std::exp(nats / 3) - 1) * Eigen::MatrixXd::Identity(kSize, kSize));
  };
  EXPECT_FALSE(Offer(settings, with_gain(0, 0.499), {}).inserted);
  EXPECT_TRUE(Offer(settings, with_gain(0, 0.501), {}).inserted);
  // 3 ln(1 + y / (1 + x)) on top of a strong one: at least a fifth of it.
  const Candidate strong = with_gain(0, 10);
  const double x = std::exp(10.0 / 3) - 1;
  const auto on_top = [&](double nats) {
    const double y = (std::exp(nats / 3) - 1) * (1 + x);
    return MakeTestCandidate(1, y * Eigen::MatrixXd::Identity(kSize, kSize));
  };
  EXPECT_FALSE(Offer(settings, on_top(0.099), std::vector{strong}).inserted);
  EXPECT_TRUE(Offer(settings, on_top(0.101), std::vector{strong}).inserted);
}

TEST(JointSelection, WhatIsNotFiniteDoesNotEnter) {
  const JointSettings settings = Settings(Criterion::kD, 5);
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity()}) {
    Candidate candidate =
        MakeTestCandidate(0, 10 * Eigen::MatrixXd::Identity(kSize, kSize));
    candidate.information(1, 2) = bad;
    EXPECT_FALSE(Offer(settings, candidate, {}).inserted);
  }
}

TEST(JointSelection, ACapacityOfZeroKeepsNone) {
  std::mt19937 random(8);
  const JointSettings settings = Settings(Criterion::kD, 0);
  EXPECT_TRUE(SelectStreaming(settings, RandomCandidates(5, &random)).empty());
  EXPECT_TRUE(SelectGreedily(settings, RandomCandidates(5, &random)).empty());
}

// Greedy growth alone is at least 1 - 1/e of the best gain (Nemhauser, Wolsey,
// Fisher 1978: 1/2 ln det is submodular); exchanges only raise it.
TEST(JointSelection, GreedyIsNearTheBestOfAllSubsets) {
  std::mt19937 random(9);
  constexpr int kCount = 9, kKept = 3;
  JointSettings settings = Settings(Criterion::kD, kKept);
  settings.share_landmarks = false;
  double streaming = 0, best_sum = 0;
  for (int trial = 0; trial < 30; ++trial) {
    const std::vector<Candidate> candidates = RandomCandidates(kCount, &random);
    double best = 0;
    for (int a = 0; a < kCount; ++a) {
      for (int b = a + 1; b < kCount; ++b) {
        for (int c = b + 1; c < kCount; ++c) {
          best = std::max(best, ValueOf(settings, candidates, {a, b, c}));
        }
      }
    }
    const double greedy =
        ValueOf(settings, candidates, SelectGreedily(settings, candidates));
    EXPECT_GE(greedy, (1 - std::exp(-1)) * best);
    EXPECT_LE(greedy, best + 1e-9);
    best_sum += best;
    streaming +=
        ValueOf(settings, candidates, SelectStreaming(settings, candidates));
  }
  EXPECT_GE(streaming, 0.9 * best_sum);
}

// A rig whose free components are kSize, with a prior of one in every unit.
Rig SmallRig(Selection selection) {
  Rig rig;
  rig.factory.cameras.resize(1);
  rig.factory.cameras[0].distortion.setZero(1);
  rig.fixed = {"cam0.*", "imu.accel.*", "imu.q_AI.*"};
  rig.groups = {{"a", {"imu.gyro.scale.*"}}, {"b", {"imu.gyro.mis*"}}};
  rig.prior_sigmas = {{"*", 1}};
  rig.table_size = 3;
  rig.min_gain_nats = 0.5;
  rig.selection = selection;
  return rig;
}

TableUpdate DecideAndApply(const Rig& rig,
                           const Candidate& candidate,
                           const std::vector<Candidate>& set,
                           Table* table) {
  std::vector<SegmentKey> keys;
  for (const Candidate& kept : set) keys.push_back(kept.key);
  return Apply(
      rig, candidate, Decide(rig, candidate, set, *table), keys, table);
}

TEST(JointTable, HoldsTheSelectedSegments) {
  std::mt19937 random(10);
  for (const auto& [selection, criterion] :
       {std::pair(Selection::kJointD, Criterion::kD),
        std::pair(Selection::kJointA, Criterion::kA),
        std::pair(Selection::kJointE, Criterion::kE)}) {
    const Rig rig = SmallRig(selection);
    std::vector<Table> tables = MakeTables(rig);
    ASSERT_EQ(tables.size(), 1u);
    EXPECT_EQ(tables[0].group, kJointTable);
    EXPECT_EQ(tables[0].capacity, 6);
    const std::vector<Candidate> candidates = RandomCandidates(40, &random);
    std::vector<Candidate> set;
    int offered = 0;
    for (const Candidate& candidate : candidates) {
      const TableUpdate change =
          DecideAndApply(rig, candidate, set, &tables[0]);
      EXPECT_EQ(tables[0].scored, ++offered);
      if (change.evicted) {
        std::erase_if(set, [&](const Candidate& kept) {
          return kept.key == change.evicted->key;
        });
      }
      if (!change.inserted) continue;
      set.push_back(candidate);
      // Again: not even counted.
      EXPECT_FALSE(DecideAndApply(rig, candidate, set, &tables[0]).inserted);
      EXPECT_EQ(tables[0].scored, offered);
    }
    std::vector<SegmentKey> expected;
    const JointSettings settings = MakeJointSettings(rig, criterion);
    for (const int i : SelectStreaming(settings, candidates)) {
      expected.push_back(candidates[i].key);
    }
    std::vector<SegmentKey> kept;
    for (const TableEntry& entry : UnionOfTables(tables)) {
      kept.push_back(entry.key);
      EXPECT_GE(entry.gain, rig.min_gain_nats / 6);
    }
    EXPECT_EQ(kept, expected);
    EXPECT_TRUE(std::is_sorted(
        tables[0].entries.begin(), tables[0].entries.end(), Better));
  }
}

TEST(JointTable, HasTheEntropyOfAllOfThetaByTheSegmentAlone) {
  std::mt19937 random(11);
  Rig rig = SmallRig(Selection::kJointD);
  Table table = MakeTables(rig)[0];
  SegmentInformation information;
  const int size = TangentSize(rig.factory);
  information.Lambda.setZero(size, size);
  information.Lambda.topLeftCorner<kSize, kSize>() =
      RandomInformation(kSize, kSize, 3, &random);
  const Candidate candidate = MakeCandidate(rig, {"s", 1}, 7, information);
  ASSERT_TRUE(DecideAndApply(rig, candidate, {}, &table).inserted);
  rig.groups = {{"all", {"*"}}};
  const GroupScore expected = ScoreGroups(rig, information.Lambda)[0];
  EXPECT_NEAR(table.entries[0].entropy, expected.entropy, 1e-9);
  EXPECT_NEAR(table.entries[0].gain, expected.gain, 1e-9);
  EXPECT_EQ(table.entries[0].sequence, 7);
}

// As soon as a table of the groups would be full, and then as tables are.
TEST(JointTable, IsReadyWithAsManyAsOneGroupNeeds) {
  const Rig rig = SmallRig(Selection::kJointD);
  std::vector<Table> tables = MakeTables(rig);
  std::vector<SegmentKey> keys;
  const auto add = [&](int i) {
    keys.push_back({"s", i});
    tables[0].entries.push_back({keys.back(), i, 1.0 * i, 1});
  };
  EXPECT_EQ(EvaluateTrigger(rig, tables, {}), Trigger::kNone);
  add(0);
  add(1);
  EXPECT_EQ(EvaluateTrigger(rig, tables, {}), Trigger::kNone);
  add(2);
  EXPECT_EQ(EvaluateTrigger(rig, tables, {}), Trigger::kTablesFull);
  const std::vector<SegmentKey> last = keys;
  EXPECT_EQ(EvaluateTrigger(rig, tables, last), Trigger::kNone);
  add(3);
  add(4);
  EXPECT_EQ(EvaluateTrigger(rig, tables, last), Trigger::kNone);
  add(5);  // 3 of 6 are new
  EXPECT_EQ(EvaluateTrigger(rig, tables, last), Trigger::kTablesChanged);
}

TEST(JointSettings, KeepAsManyAsTheTablesOfTheRig) {
  Rig rig;
  rig.factory.cameras.resize(1);
  rig.factory.cameras[0].distortion.setZero(1);
  rig.groups = {{"a", {"imu.*"}}, {"b", {"cam0.*"}}};
  rig.table_size = 5;
  rig.min_gain_nats = 2;
  rig.prior_sigmas = {{"imu.gyro.scale.x", 1}};
  const JointSettings settings = MakeJointSettings(rig, Criterion::kA);
  EXPECT_EQ(settings.capacity, 10);
  EXPECT_EQ(settings.min_gain_nats, 2);
  EXPECT_EQ(settings.criterion, Criterion::kA);
  EXPECT_DOUBLE_EQ(settings.prior_in_reference[0], 1 / ReferenceSigmas(rig)[0]);
  EXPECT_DOUBLE_EQ(settings.prior_in_reference[1], 10);
}

}  // namespace
}  // namespace selfcal
