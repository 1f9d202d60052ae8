// selfcal cohort.
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

class CohortVersions : public Commands {
 protected:
  CohortVersions() {
    for (const int version : {3, 2}) Add("t4", version, true);
    Add("t5", 1, false);
  }

  void Add(const std::string& value, int version, bool estimated) {
    v1::CohortVersion* added = daemon_.cohorts.add_cohorts();
    added->set_label("model");
    added->set_value(value);
    added->set_version(version);
    v1::Cohort* cohort = added->mutable_cohort();
    cohort->set_rigs(10 + version);
    cohort->set_calibrated(estimated ? 10 : 4);
    cohort->set_estimated(estimated);
    if (estimated) cohort->mutable_prior()->set_pixel_sigma_px(version);
  }
};

TEST_F(CohortVersions, AreListed) {
  const Outcome all = Selfcal({"cohort", "list"});
  ASSERT_EQ(all.code, 0) << all.err;
  EXPECT_THAT(all.out,
              AllOf(HasSubstr("model=t4\t3\t"),
                    HasSubstr("\t13\t10\t0\tyes"),
                    HasSubstr("model=t5\t1\t")));
  const Outcome one = Selfcal({"cohort", "list", "model=t5"});
  EXPECT_THAT(one.out, AllOf(HasSubstr("model=t5"), Not(HasSubstr("t4"))));
  EXPECT_THAT(one.out, HasSubstr("\t11\t4\t0\tno"));
}

TEST_F(CohortVersions, PriorIsARigWithTheNameAndTheLabel) {
  const Outcome newest = Selfcal({"cohort", "prior", "model=t4", "tablet-9"});
  ASSERT_EQ(newest.code, 0) << newest.err;
  EXPECT_THAT(newest.out,
              AllOf(HasSubstr("\"rigs/tablet-9\""),
                    HasSubstr("\"model\""),
                    HasSubstr("\"t4\""),
                    HasSubstr("3")));
  const Outcome second =
      Selfcal({"cohort", "prior", "model=t4", "tablet-9", "--version", "2"});
  EXPECT_NE(second.out, newest.out);
}

TEST_F(CohortVersions, WhatThereIsNotIsExplained) {
  const auto error = [&](std::vector<std::string> arguments) {
    const Outcome outcome = Selfcal(std::move(arguments));
    EXPECT_NE(outcome.code, 0);
    EXPECT_THAT(outcome.out, testing::IsEmpty());
    return outcome.err;
  };
  EXPECT_THAT(error({"cohort", "prior", "t4", "x"}), HasSubstr("LABEL=VALUE"));
  EXPECT_THAT(error({"cohort", "prior", "model=t6", "x"}),
              HasSubstr("selfcal cohort list"));
  EXPECT_THAT(error({"cohort", "prior", "model=t5", "x"}),
              HasSubstr("only 4 devices"));
  EXPECT_THAT(error({"cohort", "prior", "model=t4", "x", "--version", "9"}),
              HasSubstr("no such version"));
}

}  // namespace
}  // namespace selfcal::client
