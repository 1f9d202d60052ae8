// selfcal rig update, of one rig and of all rigs of a filter.
#include <gmock/gmock.h>

#include "test/client/cli/commands_fixture.h"

namespace selfcal::client {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::Pair;
using testing::UnorderedElementsAre;

class RigUpdate : public Commands {
 protected:
  // Two rigs of a batch, one of which is labelled already.
  RigUpdate() {
    for (const char* name : {"a", "b"}) {
      v1::Rig& rig = daemon_.rigs.emplace_back(ToProto(ARig(name)));
      (*rig.mutable_labels())["batch"] = "7";
    }
    (*daemon_.rigs[1].mutable_labels())["site"] = "north";
  }

  Outcome Update(std::vector<std::string> more) const {
    std::vector<std::string> line = {
        "rig", "update", "--filter", "labels.batch = \"7\""};
    line.insert(line.end(), more.begin(), more.end());
    return Selfcal(line);
  }
};

TEST_F(RigUpdate, ChangesOneRig) {
  const Outcome outcome =
      Selfcal({"rig", "update", "a", "--label", "site=south"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  ASSERT_EQ(daemon_.updates.size(), 1u);
  EXPECT_EQ(daemon_.updates[0].rig().name(), "rigs/a");
  EXPECT_THAT(daemon_.updates[0].rig().labels(),
              UnorderedElementsAre(Pair("batch", "7"), Pair("site", "south")));
  EXPECT_THAT(daemon_.updates[0].update_mask().paths(), ElementsAre("labels"));
}

TEST_F(RigUpdate, ChangesEachRigOfAFilterByWhatItIs) {
  const Outcome outcome =
      Update({"--label", "site=south", "--min-gain", "2", "--yes"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(daemon_.last_filter, "labels.batch = \"7\"");
  EXPECT_THAT(outcome.out, HasSubstr("a\tlabels, min_gain_nats"));
  ASSERT_EQ(daemon_.updates.size(), 2u);
  for (const v1::UpdateRigRequest& update : daemon_.updates) {
    EXPECT_THAT(
        update.rig().labels(),
        UnorderedElementsAre(Pair("batch", "7"), Pair("site", "south")));
    EXPECT_EQ(update.rig().min_gain_nats(), 2);
    EXPECT_THAT(update.update_mask().paths(),
                ElementsAre("labels", "min_gain_nats"));
  }
}

// A command that fails for some rigs is repeated.
TEST_F(RigUpdate, LeavesARigThatIsSoAlready) {
  const Outcome outcome = Update({"--label", "site=north", "--yes"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  ASSERT_EQ(daemon_.updates.size(), 1u);
  EXPECT_EQ(daemon_.updates[0].rig().name(), "rigs/a");
  EXPECT_THAT(outcome.out, Not(HasSubstr("b\t")));
}

TEST_F(RigUpdate, OnlyShowsWhatItWouldDo) {
  const Outcome outcome = Update({"--remove-label", "site", "--dry-run"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("b\tlabels"));
  EXPECT_THAT(daemon_.updates, IsEmpty());
}

TEST_F(RigUpdate, IsAListOfTheRigsAsTheyWillBeInJson) {
  const Outcome outcome =
      Update({"--remove-label", "site", "--dry-run", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto rig = Parse<v1::Rig>(outcome.out);
  EXPECT_EQ(rig.name(), "rigs/b");
  EXPECT_THAT(rig.labels(), ElementsAre(Pair("batch", "7")));
  EXPECT_EQ(rig.factory().cameras_size(), 1);
}

TEST_F(RigUpdate, GoesOnAfterARigThatFails) {
  daemon_.deleted = "rigs/a";
  const Outcome outcome = Update({"--label", "site=south", "--yes"});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("a is not changed"));
  EXPECT_THAT(outcome.err, HasSubstr("1 of 2 rigs failed"));
  ASSERT_EQ(daemon_.updates.size(), 1u);
  EXPECT_EQ(daemon_.updates[0].rig().name(), "rigs/b");
}

TEST_F(RigUpdate, ChangesNothingIfItCannotBeReadForOneRig) {
  const Outcome outcome =
      Update({"--prior-sigma", "cam3.focal=2", "--label", "x=y", "--yes"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("rigs/a"));
  EXPECT_THAT(daemon_.updates, IsEmpty());
}

TEST_F(RigUpdate, ClearsThePriorMean) {
  *daemon_.rigs[0].mutable_prior_mean() = daemon_.rigs[0].factory();
  const Outcome outcome = Update({"--clear-prior-mean", "--yes"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  ASSERT_EQ(daemon_.updates.size(), 1u);  // the other one has none
  EXPECT_EQ(daemon_.updates[0].rig().name(), "rigs/a");
  EXPECT_FALSE(daemon_.updates[0].rig().has_prior_mean());
  EXPECT_THAT(daemon_.updates[0].update_mask().paths(),
              ElementsAre("prior_mean"));
}

// A rig is changed at once.
TEST_F(RigUpdate, HasNoDryRunOfOneRig) {
  const Outcome outcome =
      Selfcal({"rig", "update", "a", "--label", "a=b", "--dry-run"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("--filter"));
  EXPECT_THAT(daemon_.updates, IsEmpty());
}

TEST_F(RigUpdate, NeedsARigOrAFilterAndAChange) {
  EXPECT_EQ(Selfcal({"rig", "update", "--label", "a=b"}).code, 2);
  EXPECT_EQ(Selfcal({"rig", "update", "a"}).code, 2);
  EXPECT_EQ(Update({"--yes"}).code, 2);
  EXPECT_EQ(
      Selfcal({"rig", "update", "a", "--filter", "f", "--label", "a=b"}).code,
      2);
}

}  // namespace
}  // namespace selfcal::client
