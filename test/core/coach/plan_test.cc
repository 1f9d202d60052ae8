#include "core/coach/plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/coach/words.h"
#include "core/model/symmetric_eigen.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

constexpr PlanGoal kGoal;

// Knows all but these components to a hundredth of their prior, and these as
// before any data.
Eigen::MatrixXd AllBut(const Rig& rig, const std::vector<int>& unknown) {
  Eigen::VectorXd sigmas = 0.01 * PriorSigmas(rig);
  for (const int k : unknown) sigmas[k] *= 100;
  return sigmas.cwiseAbs2().cwiseInverse().asDiagonal();
}

double LargestSigma(const Rig& rig, const Eigen::MatrixXd& information) {
  const auto free = FreeComponents(rig);
  const Eigen::VectorXd prior = PriorSigmas(rig)(free);
  const Eigen::MatrixXd normalised =
      prior.asDiagonal() * information(free, free) * prior.asDiagonal();
  return 1 / std::sqrt(SymmetricEigenvalues(normalised)[0]);
}

Eigen::MatrixXd InformationOf(const Predictions& predictions,
                              const Lesson& lesson) {
  const auto motion = std::find_if(predictions.motions.begin(),
                                   predictions.motions.end(),
                                   [&](const MotionPrediction& prediction) {
                                     return prediction.motion == lesson.motion;
                                   });
  return lesson.segments * motion->Lambda;
}

// A motion that measures one component to this fraction of its prior.
MotionPrediction Measures(const Rig& rig,
                          std::string_view name,
                          int component,
                          double sigma) {
  const auto size = TangentSize(rig.factory);
  MotionPrediction motion{name, "Do it.", Eigen::MatrixXd::Zero(size, size)};
  const double absolute = sigma * PriorSigmas(rig)[component];
  motion.Lambda(component, component) = 1 / (absolute * absolute);
  return motion;
}

TEST(Plan, IsEmptyOnceEveryDirectionIsLearned) {
  const Rig rig = StereoRig();
  const Predictions predictions = Predict(rig, rig.factory);
  const Plan plan = MakePlan(rig, predictions, AllBut(rig, {}), kGoal);
  EXPECT_TRUE(plan.lessons.empty());
  EXPECT_TRUE(plan.missing.empty());
}

// sigma falls from 1 to 1 / sqrt(1 + n / s^2).
TEST(Plan, CountsTheSegmentsUntilADirectionIsLearned) {
  const Rig rig = HandheldRig("r");
  const int unknown = FreeComponents(rig)[4];
  const std::string name = TangentComponents(rig.factory)[unknown].name;
  Predictions predictions;
  predictions.motions = {Measures(rig, "other", FreeComponents(rig)[5], 0.001),
                         Measures(rig, "slow", unknown, 2),
                         Measures(rig, "fast", unknown, 1.3)};
  const Plan plan = MakePlan(rig, predictions, AllBut(rig, {unknown}), kGoal);
  ASSERT_EQ(plan.lessons.size(), 1u);
  EXPECT_EQ(plan.lessons[0].motion, "fast");
  EXPECT_EQ(plan.lessons[0].instruction, "Do it.");
  EXPECT_EQ(plan.lessons[0].segments, 6);  // 3 * 1.3^2 = 5.07
  ASSERT_EQ(plan.missing.size(), 1u);
  EXPECT_EQ(plan.missing[0].words, ComponentInWords(name));
  EXPECT_EQ(plan.missing[0].parts.front().component, name);
  EXPECT_EQ(plan.missing[0].motion, "fast");
  EXPECT_NEAR(plan.missing[0].sigma, 1, 1e-6);
  EXPECT_NEAR(plan.missing[0].sigma_after, 1 / std::sqrt(1 + 6 / 1.69), 1e-6);
}

TEST(Plan, NamesTheLessonOfEachDirection) {
  const Rig rig = HandheldRig("r");
  const auto free = FreeComponents(rig);
  const auto names = TangentComponents(rig.factory);
  Predictions predictions;
  predictions.motions = {Measures(rig, "a", free[2], 0.5),
                         Measures(rig, "b", free[7], 1)};
  const Plan plan = MakePlan(rig,
                             predictions,
                             AllBut(rig, {free[2], free[7]}),
                             {.learned_below = 0.4});
  ASSERT_EQ(plan.lessons.size(), 2u);
  EXPECT_EQ(plan.lessons[0].motion, "b");
  EXPECT_EQ(plan.lessons[0].segments, 6);
  EXPECT_EQ(plan.lessons[1].motion, "a");
  EXPECT_EQ(plan.lessons[1].segments, 2);
  ASSERT_EQ(plan.missing.size(), 2u);
  for (const MissingDirection& missing : plan.missing) {
    const bool first = missing.parts.front().component == names[free[2]].name;
    EXPECT_EQ(missing.motion, first ? "a" : "b");
  }
}

// What no motion teaches is missing without a lesson, and costs no time.
TEST(Plan, HasNoLessonForWhatNoMotionTeaches) {
  const Rig rig = HandheldRig("r");
  const auto free = FreeComponents(rig);
  Predictions predictions;
  predictions.motions = {Measures(rig, "a", free[2], 0.5)};
  const Plan plan = MakePlan(rig, predictions, AllBut(rig, {free[7]}), kGoal);
  EXPECT_TRUE(plan.lessons.empty());
  ASSERT_EQ(plan.missing.size(), 1u);
  EXPECT_EQ(plan.missing[0].motion, "");
  EXPECT_NEAR(plan.missing[0].sigma_after, plan.missing[0].sigma, 1e-9);
}

TEST(Plan, EndsAtItsLimit) {
  const Rig rig = HandheldRig("r");
  const int unknown = FreeComponents(rig)[2];
  Predictions predictions;
  predictions.motions = {Measures(rig, "a", unknown, 3)};
  const Plan plan = MakePlan(rig, predictions, AllBut(rig, {unknown}), kGoal);
  ASSERT_EQ(plan.lessons.size(), 1u);
  EXPECT_EQ(plan.lessons[0].segments, kMostPlannedSegments);
  EXPECT_GT(plan.missing[0].sigma_after, kGoal.learned_below);
}

// With nothing missing, of the motion that Advise ranks first.
TEST(Plan, HasAsManySegmentsAsAreNeeded) {
  const Rig rig = HandheldRig("r");
  const auto free = FreeComponents(rig);
  Predictions predictions;
  predictions.motions = {Measures(rig, "a", free[2], 0.01),
                         Measures(rig, "b", free[7], 0.005)};
  const Plan plan =
      MakePlan(rig, predictions, AllBut(rig, {}), {.segments = 1});
  ASSERT_EQ(plan.lessons.size(), 1u);
  EXPECT_EQ(plan.lessons[0].motion, "b");
  EXPECT_EQ(plan.lessons[0].segments, 1);
  EXPECT_TRUE(plan.missing.empty());

  int segments = 0;
  for (const Lesson& lesson :
       MakePlan(rig, predictions, AllBut(rig, {free[2]}), {.segments = 4})
           .lessons) {
    segments += lesson.segments;
  }
  EXPECT_EQ(segments, 4);
}

// The lessons of a new device, done, leave nothing missing.
TEST(Plan, OfANewDeviceIsEnough) {
  for (const Rig& rig : {HandheldRig("r"), StereoRig()}) {
    const Predictions predictions = Predict(rig, rig.factory);
    const Eigen::MatrixXd prior = AllBut(rig, FreeComponents(rig));
    const Plan plan = MakePlan(rig, predictions, prior, {.learned_below = 0.1});
    ASSERT_FALSE(plan.lessons.empty());
    EXPECT_EQ(plan.missing.size(), FreeComponents(rig).size());
    Eigen::MatrixXd known = prior;
    int segments = 0;
    for (const Lesson& lesson : plan.lessons) {
      known += InformationOf(predictions, lesson);
      segments += lesson.segments;
    }
    EXPECT_LT(segments, kMostPlannedSegments);
    EXPECT_LE(LargestSigma(rig, known), 0.1);
    EXPECT_TRUE(MakePlan(rig, predictions, known, {.learned_below = 0.1})
                    .missing.empty());
    for (const MissingDirection& missing : plan.missing) {
      EXPECT_NEAR(missing.sigma, 1, 1e-6);
      EXPECT_LT(missing.sigma_after, 0.1 * 1.0001);
    }
  }
}

}  // namespace
}  // namespace selfcal
