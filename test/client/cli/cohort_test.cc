// selfcal cohort show.
#include <gmock/gmock.h>

#include "test/client/cli/commands_fixture.h"

namespace selfcal::client {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class CohortShow : public Commands {
 protected:
  CohortShow() {
    v1::Cohort& cohort = daemon_.cohort;
    cohort.set_reference("rigs/device0");
    cohort.set_rigs(12);
    cohort.set_calibrated(10);
    cohort.set_estimated(true);
    auto* focal = cohort.add_components();
    focal->set_component("cam0.focal.x");
    focal->set_unit("px");
    focal->set_mean_offset(1.234);
    focal->set_mean_offset_sigma(0.12);
    focal->set_spread(0.5);
    focal->set_spread_degrees(9);
    focal->set_tolerance(5);
    for (const double q : {0.3, 0.9, 1.2, 1.6, 2.1}) {
      focal->add_quantile_offsets(q);
    }
    auto* outlier = cohort.add_outliers();
    outlier->set_rig("rigs/knocked");
    outlier->set_version(7);
    outlier->set_probability(3e-9);
    auto* component = outlier->add_components();
    component->set_component("cam0.q_CI.x");
    component->set_unit("rad");
    component->set_difference(0.01);
    component->set_sigma(0.001);
    auto* skipped = cohort.add_skipped();
    skipped->set_rig("rigs/new");
    skipped->set_reason("its factory calibration is active");
  }
};

TEST_F(CohortShow, ShowsSpreadsOutliersAndWhoDoesNotCount) {
  const Outcome outcome = Selfcal({"cohort",
                                   "show",
                                   "--filter",
                                   "labels.model = \"t4\"",
                                   "--max-rigs",
                                   "20"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out,
              AllOf(HasSubstr("12 looked at, 10 calibrated"),
                    HasSubstr("cam0.focal.x\tpx\t1.23\t0.12\t0.5\t5"),
                    HasSubstr("knocked\t7\t3e-09\tcam0.q_CI.x by 0.573 +- "
                              "0.057 deg"),
                    HasSubstr("new\tits factory calibration is active")));
  EXPECT_EQ(daemon_.cohort_request.filter(), "labels.model = \"t4\"");
  EXPECT_EQ(daemon_.cohort_request.max_rigs(), 20);
}

TEST_F(CohortShow, SaysWhereTooFewAreCalibrated) {
  daemon_.cohort.set_estimated(false);
  daemon_.cohort.set_truncated(true);
  const Outcome outcome = Selfcal({"cohort", "show"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out,
              AllOf(HasSubstr("there are more"),
                    HasSubstr("too few devices are calibrated"),
                    Not(HasSubstr("1.23"))));
}

TEST_F(CohortShow, RefusesMoreRigsThanTheDaemonTakes) {
  EXPECT_EQ(Selfcal({"cohort", "show", "--max-rigs", "2001"}).code, 2);
}

}  // namespace
}  // namespace selfcal::client
