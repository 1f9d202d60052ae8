#include <set>
#include <string>

#include "core/coach/primitives.h"
#include "test/server/grpc/service_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;

class AdviseMotionTest : public ServiceTest {
 protected:
  grpc::Status Advise(const std::string& parent, int max_advice = 0) {
    Context context;
    v1::AdviseMotionRequest request;
    request.set_parent(parent);
    request.set_max_advice(max_advice);
    return calibrations_->AdviseMotion(&context, request, &response_);
  }

  v1::AdviseMotionResponse response_;
};

TEST_F(AdviseMotionTest, SaysWhatToDoAndWhatItBrings) {
  const Rig rig = AddRig();
  const auto status = Advise("rigs/r");
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(response_.calibration_version(), 1);
  EXPECT_EQ(response_.segments_since(), 0);
  EXPECT_EQ(response_.segment_seconds(), 4);
  ASSERT_EQ(response_.advice_size(), 3);
  double last = response_.advice(0).gain_nats();
  for (const auto& advice : response_.advice()) {
    ASSERT_NE(FindPrimitive(advice.motion()), nullptr);
    EXPECT_EQ(advice.instruction(),
              FindPrimitive(advice.motion())->instruction);
    EXPECT_GT(advice.gain_nats(), 0);
    EXPECT_LE(advice.gain_nats(), last);
    last = advice.gain_nats();
    ASSERT_EQ(advice.group_gains_size(), static_cast<int>(rig.groups.size()));
    EXPECT_EQ(advice.group_gains(0).group(), rig.groups[0].name);
    EXPECT_GT(advice.group_gains(0).gain_nats(), 0);
    ASSERT_EQ(advice.sigma_changes_size(),
              static_cast<int>(FreeComponents(rig).size()));
    const auto& change = advice.sigma_changes(0);
    EXPECT_EQ(change.component(), "imu.gyro.scale.x");
    EXPECT_EQ(change.unit(), "-");
    EXPECT_NEAR(change.sigma_now(), PriorSigmas(rig)[0], 1e-9);
    EXPECT_LT(change.sigma_after(), change.sigma_now());
  }
  ASSERT_EQ(response_.weakest_size(), 3);
  for (const auto& weak : response_.weakest()) {
    EXPECT_FALSE(weak.words().empty());
    EXPECT_GE(weak.parts_size(), 1);
    EXPECT_NEAR(weak.sigma_by_reference(), 10, 1e-6);
  }
}

// Of a new device everything is missing, and less than a minute teaches it.
TEST_F(AdviseMotionTest, SaysWhatToRecordForHowLong) {
  const Rig rig = AddRig();
  ASSERT_TRUE(Advise("rigs/r").ok());
  std::set<std::string> motions;
  double seconds = 0;
  for (const auto& lesson : response_.lessons()) {
    ASSERT_NE(FindPrimitive(lesson.motion()), nullptr);
    EXPECT_EQ(lesson.instruction(),
              FindPrimitive(lesson.motion())->instruction);
    EXPECT_GE(lesson.seconds(), response_.segment_seconds());
    motions.insert(lesson.motion());
    seconds += lesson.seconds();
  }
  EXPECT_GT(seconds, 0);
  EXPECT_LT(seconds, 60);
  ASSERT_EQ(response_.missing_size(),
            static_cast<int>(FreeComponents(rig).size()));
  for (const auto& missing : response_.missing()) {
    EXPECT_FALSE(missing.words().empty());
    EXPECT_GE(missing.parts_size(), 1);
    EXPECT_NEAR(missing.sigma_by_prior(), 1, 1e-6);
    EXPECT_LE(missing.sigma_by_prior_after(), 0.5);
    EXPECT_TRUE(motions.contains(missing.motion()));
  }
}

TEST_F(AdviseMotionTest, GivesAsManyAsAreAskedFor) {
  AddRig();
  ASSERT_TRUE(Advise("rigs/r", 1).ok());
  EXPECT_EQ(response_.advice_size(), 1);
  ASSERT_TRUE(Advise("rigs/r", 1'000'000).ok());
  EXPECT_EQ(response_.advice_size(), static_cast<int>(Primitives().size()));
  EXPECT_EQ(response_.advice(response_.advice_size() - 1).motion(),
            "hold_still");
}

TEST_F(AdviseMotionTest, RefusesWhatItCannotAnswer) {
  AddRig();
  EXPECT_THAT(BadFields(Advise("r")), ElementsAre("parent"));
  EXPECT_THAT(BadFields(Advise("rigs/r", -1)), ElementsAre("max_advice"));
  ExpectNotFound(Advise("rigs/nobody"), "rigs/nobody");
}

}  // namespace
}  // namespace selfcal::server
