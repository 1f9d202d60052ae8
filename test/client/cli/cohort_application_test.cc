// selfcal cohort apply.
#include <gmock/gmock.h>

#include "test/client/cli/commands_fixture.h"

namespace selfcal::client {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

class CohortApply : public Commands {
 protected:
  // A cohort whose mean is 3 px from the factory's focal length, and two of its
  // rigs; the version before was 1 px from it.
  CohortApply() {
    for (const int version : {2, 1}) {
      v1::CohortVersion* added = daemon_.cohorts.add_cohorts();
      added->set_label("model");
      added->set_value("t4");
      added->set_version(version);
      Rig prior = ARig("prior");
      prior.factory.cameras[0].f.x() += version == 2 ? 3 : 1;
      prior.prior_sigmas = {{"cam0.focal.x", 0.5}, {"cam0.focal.y", 0.4}};
      *added->mutable_cohort()->mutable_prior() = ToProto(prior);
      added->mutable_cohort()->mutable_prior()->clear_name();
      for (const char* name : {"cam0.focal.x", "cam0.focal.y"}) {
        v1::CohortComponent* component =
            added->mutable_cohort()->add_components();
        component->set_component(name);
        component->set_spread_degrees(10);
      }
    }
    for (const char* name : {"a", "b"}) AddRig(ARig(name));
  }

  v1::Rig& AddRig(const Rig& rig) {
    v1::Rig& added = daemon_.rigs.emplace_back(ToProto(rig));
    (*added.mutable_labels())["model"] = "t4";
    return added;
  }

  Outcome Apply(std::vector<std::string> more) const {
    std::vector<std::string> line = {"cohort",
                                     "apply",
                                     "model=t4",
                                     "--filter",
                                     "labels.site = \"north\"",
                                     "--reason",
                                     "new statistics"};
    line.insert(line.end(), more.begin(), more.end());
    return Selfcal(line);
  }

  // The rig "c", whose reason this is, is left out, and the others are changed.
  void ExpectLeftOut(const std::string& reason) {
    daemon_.updates.clear();
    const Outcome outcome = Apply({"--yes"});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_THAT(outcome.err,
                AllOf(HasSubstr("c is left out: "), HasSubstr(reason)));
    EXPECT_THAT(outcome.out, Not(HasSubstr("c\t")));
    EXPECT_EQ(daemon_.updates.size(), 2u);
  }
};

TEST_F(CohortApply, GivesMeanAndSigmasInOneUpdate) {
  const Outcome outcome = Apply({"--yes"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(daemon_.last_filter, "labels.site = \"north\"");
  EXPECT_THAT(
      outcome.out,
      AllOf(HasSubstr("a\t2\tcam0.focal.x by 6.0 sigma"), HasSubstr("b\t2\t")));
  ASSERT_EQ(daemon_.updates.size(), 2u);
  const v1::UpdateRigRequest& update = daemon_.updates[0];
  EXPECT_EQ(update.rig().name(), "rigs/a");
  EXPECT_EQ(update.reason(), "new statistics");
  EXPECT_THAT(update.update_mask().paths(),
              ElementsAre("prior_mean", "prior_sigmas"));
  EXPECT_EQ(update.rig().prior_mean().cameras(0).f().x(), 258);
  ASSERT_EQ(update.rig().prior_sigmas_size(), 2);
  EXPECT_EQ(update.rig().prior_sigmas(0).pattern(), "cam0.focal.x");
  EXPECT_EQ(update.rig().prior_sigmas(0).value(), 0.5);
}

TEST_F(CohortApply, GivesAnEarlierVersion) {
  ASSERT_EQ(Apply({"--yes", "--version", "1"}).code, 0);
  ASSERT_EQ(daemon_.updates.size(), 2u);
  EXPECT_EQ(daemon_.updates[0].rig().prior_mean().cameras(0).f().x(), 256);
}

// The time offset is known, and not the same on every device.
TEST_F(CohortApply, KeepsTheFactoryValueOfWhatIsNotEstimated) {
  daemon_.rigs[0].mutable_factory()->mutable_cameras(0)->set_time_offset_s(
      0.01);
  ASSERT_EQ(Apply({"--yes"}).code, 0);
  ASSERT_EQ(daemon_.updates.size(), 2u);
  const auto& camera = daemon_.updates[0].rig().prior_mean().cameras(0);
  EXPECT_EQ(camera.time_offset_s(), 0.01);
  EXPECT_EQ(camera.f().x(), 258);
}

// As each device was made: the cohort has only what one of them has.
TEST_F(CohortApply, KeepsThePriorOfWhatNoDeviceDetermines) {
  v1::Cohort* cohort = daemon_.cohorts.mutable_cohorts(0)->mutable_cohort();
  cohort->mutable_components(1)->set_spread_degrees(0);
  cohort->mutable_prior()
      ->mutable_factory()
      ->mutable_cameras(0)
      ->mutable_f()
      ->set_y(300);
  for (const auto& [pattern, value] :
       {std::pair("*.focal.*", 7), std::pair("cam0.focal.x", 6)}) {
    v1::ComponentSetting* sigma = daemon_.rigs[0].add_prior_sigmas();
    sigma->set_pattern(pattern);
    sigma->set_value(value);
  }
  ASSERT_EQ(Apply({"--yes"}).code, 0);
  ASSERT_EQ(daemon_.updates.size(), 2u);
  const v1::Rig& rig = daemon_.updates[0].rig();
  EXPECT_EQ(rig.prior_mean().cameras(0).f().x(), 258);
  EXPECT_EQ(rig.prior_mean().cameras(0).f().y(), 256);
  ASSERT_EQ(rig.prior_sigmas_size(), 2);
  EXPECT_EQ(rig.prior_sigmas(0).pattern(), "*.focal.*");
  EXPECT_EQ(rig.prior_sigmas(1).pattern(), "cam0.focal.x");
  EXPECT_EQ(rig.prior_sigmas(1).value(), 0.5);
}

TEST_F(CohortApply, OnlyShowsWhatItWouldDo) {
  const Outcome outcome = Apply({"--dry-run"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("a\t2\t"));
  EXPECT_THAT(daemon_.updates, IsEmpty());
}

TEST_F(CohortApply, IsAListOfTheRigsAsTheyWillBeInJson) {
  daemon_.rigs.resize(1);
  const Outcome outcome = Apply({"--dry-run", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto rig = Parse<v1::Rig>(outcome.out);
  EXPECT_EQ(rig.name(), "rigs/a");
  EXPECT_EQ(rig.prior_mean().cameras(0).f().x(), 258);
  EXPECT_EQ(rig.factory().cameras(0).f().x(), 255);
}

// A command that fails for some rigs is repeated.
TEST_F(CohortApply, LeavesARigThatHasThePriorAlready) {
  ASSERT_EQ(Apply({"--yes"}).code, 0);
  ASSERT_EQ(daemon_.updates.size(), 2u);
  *daemon_.rigs[0].mutable_prior_mean() = daemon_.updates[0].rig().prior_mean();
  *daemon_.rigs[0].mutable_prior_sigmas() =
      daemon_.updates[0].rig().prior_sigmas();
  daemon_.updates.clear();
  const Outcome outcome = Apply({"--yes"});
  EXPECT_THAT(outcome.out, Not(HasSubstr("a\t")));
  ASSERT_EQ(daemon_.updates.size(), 1u);
  EXPECT_EQ(daemon_.updates[0].rig().name(), "rigs/b");
}

TEST_F(CohortApply, GoesOnAfterARigThatFails) {
  daemon_.deleted = "rigs/a";
  const Outcome outcome = Apply({"--yes"});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_THAT(
      outcome.err,
      AllOf(HasSubstr("a is not changed"), HasSubstr("1 of 2 rigs failed")));
  ASSERT_EQ(daemon_.updates.size(), 1u);
}

TEST_F(CohortApply, LeavesOutRigsOfAnotherCohort) {
  (*AddRig(ARig("c")).mutable_labels())["model"] = "t5";
  ExpectLeftOut("not of the cohort model=t4");
  daemon_.rigs.back().clear_labels();
  ExpectLeftOut("not of the cohort model=t4");
}

TEST_F(CohortApply, LeavesOutRigsWithOtherCameras) {
  Rig other = ARig("c");
  other.factory.cameras.push_back(other.factory.cameras[0]);
  AddRig(other);
  ExpectLeftOut("cameras, IMUs or optional blocks differ");
  daemon_.rigs.back() = daemon_.rigs.front();
  daemon_.rigs.back().set_name("rigs/c");
  daemon_.rigs.back().mutable_factory()->mutable_cameras(0)->set_width_px(800);
  ExpectLeftOut("cameras, IMUs or optional blocks differ");
}

TEST_F(CohortApply, LeavesOutRigsThatEstimateOtherComponents) {
  Rig other = ARig("c");
  other.blocks = {{"*.time_offset", true}};
  AddRig(other);
  ExpectLeftOut("estimates other components");
}

TEST_F(CohortApply, LeavesOutOutliersUnlessTheyAreIncluded) {
  AddRig(ARig("c"));
  daemon_.cohorts.mutable_cohorts(0)->mutable_cohort()->add_outliers()->set_rig(
      "rigs/c");
  ExpectLeftOut("contradicts its cohort");
  daemon_.updates.clear();
  ASSERT_EQ(Apply({"--yes", "--outliers"}).code, 0);
  EXPECT_EQ(daemon_.updates.size(), 3u);
}

TEST_F(CohortApply, NeedsACohortWithAPriorAFilterAndAReason) {
  EXPECT_EQ(Selfcal({"cohort", "apply", "model=t4", "--reason", "r"}).code, 2);
  EXPECT_EQ(Selfcal({"cohort", "apply", "model=t4", "--filter", "f"}).code, 2);
  const auto apply = [this](const std::string& cohort) {
    return Selfcal(
        {"cohort", "apply", cohort, "--filter", "f", "--reason", "r", "--yes"});
  };
  EXPECT_THAT(apply("t4").err, HasSubstr("LABEL=VALUE"));
  EXPECT_THAT(apply("model=t6").err, HasSubstr("selfcal cohort list"));
  daemon_.cohorts.mutable_cohorts(0)->mutable_cohort()->clear_prior();
  EXPECT_THAT(apply("model=t4").err, HasSubstr("too few for a prior"));
  EXPECT_THAT(daemon_.updates, IsEmpty());
}

}  // namespace
}  // namespace selfcal::client
