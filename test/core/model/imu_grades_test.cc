#include "core/model/imu_grades.h"

#include <gtest/gtest.h>

namespace selfcal {
namespace {

Rig TestRig() {
  Rig rig;
  rig.id = "a";
  rig.factory.cameras.resize(1);
  return rig;
}

TEST(ImuGradesTest, SetEveryComponentOfTheImuAndNoOther) {
  Rig rig = TestRig();
  const Eigen::VectorXd unknown = PriorSigmas(rig);
  const auto components = TangentComponents(rig.factory);
  for (const ImuGrade grade :
       {ImuGrade::kConsumer, ImuGrade::kFactoryCalibrated}) {
    rig.prior_sigmas = ImuTolerances(grade);
    const Eigen::VectorXd sigmas = PriorSigmas(rig);
    for (Eigen::Index i = 0; i < sigmas.size(); ++i) {
      const std::string& name = components[static_cast<std::size_t>(i)].name;
      if (name.starts_with("imu.")) {
        EXPECT_LT(sigmas[i], unknown[i]) << name;
      } else {
        EXPECT_EQ(sigmas[i], unknown[i]) << name;
      }
    }
  }
}

// Data sheets state at most 3 % and one degree, and some tenths of a percent.
TEST(ImuGradesTest, AreOfTheSizeThatDataSheetsState) {
  Rig rig = TestRig();
  rig.prior_sigmas = ImuTolerances(ImuGrade::kConsumer);
  EXPECT_GE(PriorSigmas(rig).head<15>().minCoeff(), 0.01);
  EXPECT_LE(PriorSigmas(rig).head<15>().maxCoeff(), 0.03);
  rig.prior_sigmas = ImuTolerances(ImuGrade::kFactoryCalibrated);
  EXPECT_GE(PriorSigmas(rig).head<15>().minCoeff(), 1e-3);
  EXPECT_LE(PriorSigmas(rig).head<15>().maxCoeff(), 3e-3);
}

TEST(ImuGradesTest, AnUnknownGradeHasNoTolerances) {
  EXPECT_TRUE(ImuTolerances(ImuGrade::kUnknown).empty());
}

TEST(ImuGradesTest, HaveNames) {
  EXPECT_EQ(ParseImuGrade("consumer"), ImuGrade::kConsumer);
  EXPECT_EQ(ParseImuGrade("factory-calibrated"), ImuGrade::kFactoryCalibrated);
  EXPECT_EQ(ParseImuGrade("unknown"), ImuGrade::kUnknown);
  EXPECT_FALSE(ParseImuGrade("good").has_value());
  EXPECT_EQ(ImuGradeName(ImuGrade::kFactoryCalibrated), "factory-calibrated");
}

}  // namespace
}  // namespace selfcal
