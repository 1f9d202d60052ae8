#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "core/model/rig.h"
#include "test/core/model/random_values.h"
#include "test/core/model/special_values.h"

namespace selfcal {
namespace {

using testing::ElementsAre;
using testing::ElementsAreArray;
using testing::IsEmpty;

Rig ValidRig() {
  RandomValues random(1);
  Rig rig;
  rig.id = "phone-1";
  rig.factory = random.Theta();
  rig.prior_sigmas = {{"*.focal.*", 20}};
  rig.fixed = {"cam1.distortion.*"};
  return rig;
}

std::vector<std::string> ViolatedFields(
    const std::vector<Violation>& violations) {
  std::vector<std::string> fields;
  for (const Violation& violation : violations) {
    EXPECT_FALSE(violation.message.empty()) << violation.field;
    fields.push_back(violation.field);
  }
  return fields;
}

struct RigCorruption {
  std::string field;
  std::function<void(Rig*)> apply;
};

// In the order of the fields; each can be applied together with the others.
std::vector<RigCorruption> RigCorruptions() {
  return {
      {"id", [](Rig* r) { r->id = "Phone 1"; }},
      {"factory.imu.s_g", [](Rig* r) { r->factory.imu.s_g.y() = 0; }},
      {"factory.imu.m_g", [](Rig* r) { r->factory.imu.m_g.x() = kNan; }},
      {"factory.imu.s_a", [](Rig* r) { r->factory.imu.s_a.z() = 1e9; }},
      {"factory.imu.m_a", [](Rig* r) { r->factory.imu.m_a.z() = kInfinity; }},
      {"factory.imu.q_AI", [](Rig* r) { r->factory.imu.q_AI.w() += 0.1; }},
      {"factory.cameras[0].q_CI",
       [](Rig* r) { r->factory.cameras[0].q_CI.coeffs().setZero(); }},
      {"factory.cameras[0].p_CI",
       [](Rig* r) { r->factory.cameras[0].p_CI.x() = kNan; }},
      {"factory.cameras[0].f",
       [](Rig* r) { r->factory.cameras[0].f.x() = -250; }},
      {"factory.cameras[0].distortion",
       [](Rig* r) { r->factory.cameras[0].distortion[0] = 3.2; }},
      {"factory.cameras[1].c",
       [](Rig* r) { r->factory.cameras[1].c.y() = kInfinity; }},
      {"factory.cameras[1].time_offset_s",
       [](Rig* r) { r->factory.cameras[1].time_offset_s = -0.6; }},
      {"factory.cameras[1].width_px",
       [](Rig* r) { r->factory.cameras[1].width_px = 0; }},
      {"factory.cameras[2].distortion",
       [](Rig* r) { r->factory.cameras[2].distortion.setZero(3); }},
      {"factory.cameras[2].height_px",
       [](Rig* r) { r->factory.cameras[2].height_px = -480; }},
      {"imu_noise.gyro_noise_density",
       [](Rig* r) { r->imu_noise.gyro_noise_density = 0; }},
      {"imu_noise.accel_noise_density",
       [](Rig* r) { r->imu_noise.accel_noise_density = kNan; }},
      {"imu_noise.gyro_bias_random_walk",
       [](Rig* r) { r->imu_noise.gyro_bias_random_walk = -1e-5; }},
      {"imu_noise.accel_bias_random_walk",
       [](Rig* r) { r->imu_noise.accel_bias_random_walk = kInfinity; }},
      {"pixel_sigma_px", [](Rig* r) { r->pixel_sigma_px = 0; }},
      {"gravity_mps2", [](Rig* r) { r->gravity_mps2 = -9.81; }},
      {"groups[1].name", [](Rig* r) { r->groups[1].name = "imu"; }},
      {"groups[1].patterns[2]",
       [](Rig* r) { r->groups[1].patterns[2] = "*.distorsion.*"; }},
      {"groups[2].name", [](Rig* r) { r->groups[2].name = "a/b"; }},
      {"groups[2].patterns", [](Rig* r) { r->groups[2].patterns.clear(); }},
      {"prior_sigmas[0].pattern",
       [](Rig* r) { r->prior_sigmas[0].pattern = "focal"; }},
      {"prior_sigmas[0].value", [](Rig* r) { r->prior_sigmas[0].value = 0; }},
      {"fixed[0]", [](Rig* r) { r->fixed[0] = "cam7.*"; }},
      {"table_size", [](Rig* r) { r->table_size = 0; }},
      {"min_gain_nats", [](Rig* r) { r->min_gain_nats = -1; }},
      {"retrigger_fraction", [](Rig* r) { r->retrigger_fraction = 1.5; }},
  };
}

TEST(ValidateRig, ValidRigHasNoViolation) {
  EXPECT_THAT(ViolatedFields(Validate(ValidRig())), IsEmpty());
}

TEST(ValidateRig, EachCorruptionGivesExactlyItsField) {
  for (const RigCorruption& corruption : RigCorruptions()) {
    Rig rig = ValidRig();
    corruption.apply(&rig);
    EXPECT_THAT(ViolatedFields(Validate(rig)), ElementsAre(corruption.field));
  }
}

TEST(ValidateRig, AllCorruptionsTogetherGiveAllFieldsInOrder) {
  Rig rig = ValidRig();
  std::vector<std::string> expected;
  for (const RigCorruption& corruption : RigCorruptions()) {
    corruption.apply(&rig);
    expected.push_back(corruption.field);
  }
  EXPECT_THAT(ViolatedFields(Validate(rig)), ElementsAreArray(expected));
}

TEST(ValidateRig, IdHasTheAlphabetAndLengthOfAResourceName) {
  Rig rig = ValidRig();
  for (const std::string& id : {std::string(),
                                std::string(64, 'a'),
                                std::string("a.b"),
                                std::string("../x"),
                                std::string("r\xc3\xbc")}) {
    rig.id = id;
    EXPECT_THAT(ViolatedFields(Validate(rig)), ElementsAre("id")) << id;
  }
  for (const std::string& id :
       {std::string("a"), std::string(63, 'z'), std::string("0_a-b")}) {
    rig.id = id;
    EXPECT_THAT(Validate(rig), IsEmpty()) << id;
  }
}

TEST(ValidateRig, NeedsACamera) {
  Rig rig = ValidRig();
  rig.factory.cameras.clear();
  EXPECT_THAT(ViolatedFields(Validate(rig)), ElementsAre("factory.cameras"));
}

TEST(ValidateRig, TooManyCamerasAreCountedAndNotInspected) {
  Rig rig = ValidRig();
  rig.factory.cameras.assign(100'000, CameraCalibration());
  EXPECT_THAT(ViolatedFields(Validate(rig)), ElementsAre("factory.cameras"));
}

TEST(ValidateRig, EverythingFixedIsRefused) {
  Rig rig = ValidRig();
  rig.fixed = {"*"};
  EXPECT_THAT(ViolatedFields(Validate(rig)),
              ElementsAre("groups[0].patterns",
                          "groups[1].patterns",
                          "groups[2].patterns",
                          "fixed"));
}

TEST(ValidateRig, GroupThatIsFixedWholeIsRefused) {
  Rig rig = ValidRig();
  rig.fixed = {"imu.*"};
  EXPECT_THAT(ViolatedFields(Validate(rig)), ElementsAre("groups[0].patterns"));
  rig.groups.erase(rig.groups.begin());
  EXPECT_THAT(Validate(rig), IsEmpty());
}

TEST(ValidateRig, NoGroupIsNamedAsTheTableOfAJointSelection) {
  Rig rig = ValidRig();
  rig.groups[1].name = "joint";
  EXPECT_TRUE(Validate(rig).empty());
  rig.selection = Selection::kJointD;
  const auto violations = Validate(rig);
  ASSERT_EQ(violations.size(), 1u);
  EXPECT_EQ(violations[0].field, "groups[1].name");
  rig.groups[1].name = "camera";
  EXPECT_TRUE(Validate(rig).empty());
}

TEST(ValidateRig, GroupOfTimeOffsetsThatAreKnownIsRefusedWithAHint) {
  Rig rig = ValidRig();
  rig.groups = DefaultGroups({{"*.time_offset", true}});
  const std::vector<Violation> violations = Validate(rig);
  ASSERT_THAT(ViolatedFields(violations), ElementsAre("groups[3].patterns"));
  EXPECT_THAT(violations[0].message,
              testing::HasSubstr("estimate_time_offset"));
  rig.blocks = {{"*.time_offset", true}};
  EXPECT_THAT(Validate(rig), IsEmpty());
}

TEST(ValidateRig, BlockSettingThatMatchesNothingIsRefused) {
  Rig rig = ValidRig();
  rig.blocks = {{"imu.gyro.scale", false}, {"imu.gyro.scale.x", false}};
  EXPECT_THAT(ViolatedFields(Validate(rig)), ElementsAre("blocks[1].pattern"));
}

TEST(ValidateRig, NeedsAGroup) {
  Rig rig = ValidRig();
  rig.groups.clear();
  EXPECT_THAT(ViolatedFields(Validate(rig)), ElementsAre("groups"));
}

TEST(ValidateCalibration, PathsBeginWithThePrefix) {
  Calibration theta = ValidRig().factory;
  EXPECT_THAT(Validate(theta, "calibration"), IsEmpty());
  theta.imu.s_g.x() = kNan;
  theta.cameras[2].f.y() = 0;
  EXPECT_THAT(ViolatedFields(Validate(theta, "calibration")),
              ElementsAre("calibration.imu.s_g", "calibration.cameras[2].f"));
  EXPECT_THAT(ViolatedFields(Validate(theta, "")),
              ElementsAre("imu.s_g", "cameras[2].f"));
}

// What no device has, and arithmetic does not survive.
TEST(ValidateRig, ImplausibleValuesAreNamed) {
  const std::vector<RigCorruption> implausible = {
      {"imu_noise.gyro_noise_density",
       [](Rig* r) { r->imu_noise.gyro_noise_density = 1e-300; }},
      {"imu_noise.accel_noise_density",
       [](Rig* r) { r->imu_noise.accel_noise_density = 1e155; }},
      {"imu_noise.gyro_bias_random_walk",
       [](Rig* r) { r->imu_noise.gyro_bias_random_walk = 1e20; }},
      {"imu_noise.accel_bias_random_walk",
       [](Rig* r) { r->imu_noise.accel_bias_random_walk = 1e-20; }},
      {"pixel_sigma_px", [](Rig* r) { r->pixel_sigma_px = 1e-300; }},
      {"gravity_mps2", [](Rig* r) { r->gravity_mps2 = 1e300; }},
      {"prior_sigmas[0].value",
       [](Rig* r) { r->prior_sigmas[0].value = 1e155; }},
      {"prior_sigmas[0].value",
       [](Rig* r) { r->prior_sigmas[0].value = 1e-300; }},
  };
  for (const RigCorruption& corruption : implausible) {
    Rig rig = ValidRig();
    corruption.apply(&rig);
    EXPECT_THAT(ViolatedFields(Validate(rig)), ElementsAre(corruption.field));
  }
}

TEST(ValidateRig, PriorMeanIsACalibrationLikeTheFactorys) {
  Rig rig = ValidRig();
  rig.prior_mean = rig.factory;
  EXPECT_THAT(Validate(rig), IsEmpty());
  rig.prior_mean->cameras[0].f.x() += 5;
  rig.prior_mean->imu.s_g.y() += 0.01;
  EXPECT_THAT(Validate(rig), IsEmpty());
  const std::vector<RigCorruption> corruptions = {
      {"prior_mean.cameras[0].f",
       [](Rig* r) { r->prior_mean->cameras[0].f.x() = -250; }},
      {"prior_mean.imu.m_g", [](Rig* r) { r->prior_mean->imu.m_g.x() = kNan; }},
      {"prior_mean", [](Rig* r) { r->prior_mean->cameras.pop_back(); }},
      {"prior_mean", [](Rig* r) { r->prior_mean->cameras[0].width_px += 1; }},
      {"prior_mean",
       [](Rig* r) { r->prior_mean->cameras[0].line_delay_s = 1e-5; }},
  };
  for (const RigCorruption& corruption : corruptions) {
    Rig corrupt = rig;
    corruption.apply(&corrupt);
    EXPECT_THAT(ViolatedFields(Validate(corrupt)),
                ElementsAre(corruption.field));
  }
}

// The same for a component that is fixed, and one of a block that is off.
TEST(ValidateRig, PriorMeanIsTheFactorysInWhatIsNotEstimated) {
  for (const bool is_fixed : {true, false}) {
    Rig rig = ValidRig();
    rig.prior_mean = rig.factory;
    if (is_fixed) {
      rig.prior_mean->cameras[1].distortion[0] *= 1.001;
    } else {
      rig.prior_mean->cameras[1].time_offset_s += 1e-4;
    }
    const std::vector<Violation> violations = Validate(rig);
    ASSERT_THAT(ViolatedFields(violations), ElementsAre("prior_mean"));
    EXPECT_THAT(
        violations[0].message,
        testing::HasSubstr(is_fixed ? "cam1.distortion" : "cam1.time_offset"));
    rig.fixed.clear();
    rig.blocks = {{"*.time_offset", true}};
    EXPECT_THAT(Validate(rig), IsEmpty());
  }
}

}  // namespace
}  // namespace selfcal
