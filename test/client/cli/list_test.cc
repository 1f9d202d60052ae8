// --limit and --filter of the lists.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "client/cli/list_filter.h"
#include "test/client/cli/commands_fixture.h"

namespace selfcal::client {
namespace {

using testing::AllOf;
using testing::HasSubstr;

const std::vector<FilterField> kFields = {
    {"state", FilterField::Kind::kText, {"active", "rolled-back"}},
    {"segments", FilterField::Kind::kNumber},
    {"created", FilterField::Kind::kTime},
    {"detail"}};

constexpr std::int64_t kNow = 1'795'234'203;  // 2026-11-21 04:10:03

google::protobuf::Timestamp Now() {
  google::protobuf::Timestamp now;
  now.set_seconds(kNow);
  return now;
}

bool Meets(const std::string& filter) {
  const auto parsed = ListFilter::Parse(filter, kFields, Now());
  EXPECT_TRUE(parsed.ok()) << parsed.status();
  return parsed->Meets([](std::string_view field) -> FieldValue {
    if (field == "state") return std::string("rolled back");
    if (field == "segments") return 12.0;
    if (field == "created") return static_cast<double>(kNow - 3600);
    return std::string("Two words");
  });
}

std::string Refusal(const std::string& filter) {
  return std::string(
      ListFilter::Parse(filter, kFields, Now()).status().message());
}

TEST(ListFilter, TheDaemonTestsTheFieldsThatItHas) {
  using Kind = FilterField::Kind;
  const std::vector<FilterField> fields = {
      {"state", Kind::kText, {"active", "rolled-back"}, "state"},
      {"created", Kind::kTime, {}, "create_time"},
      {"temperature_c", Kind::kNumber, {}, "temperature_c"},
      {"version", Kind::kNumber}};
  const auto for_daemon = [&](const std::string& text) {
    const auto parsed = ListFilter::Parse(text, fields, Now());
    EXPECT_TRUE(parsed.ok()) << parsed.status();
    return parsed->ForDaemon();
  };
  EXPECT_EQ(for_daemon(""), "");
  EXPECT_EQ(for_daemon("version = 3 AND state != active"), "");
  EXPECT_EQ(for_daemon("state = rolled-back AND version = 3 AND "
                       "temperature_c >= -2.5"),
            "state = ROLLED_BACK AND temperature_c >= -2.5");
  EXPECT_EQ(for_daemon("created <= 1h AND created > 2h"),
            "create_time <= 2026-11-21T03:10:03Z AND "
            "create_time > 2026-11-21T02:10:03Z");
}

TEST(ListFilter, ComparesTextsNumbersAndTimes) {
  EXPECT_TRUE(Meets(""));
  EXPECT_TRUE(Meets("state = rolled-back"));
  EXPECT_TRUE(Meets("state=ROLLED_BACK AND segments>=12"));
  EXPECT_FALSE(Meets("state != rolled-back"));
  EXPECT_TRUE(Meets("segments != 11 AND segments < 12.5 AND segments <= 12"));
  EXPECT_FALSE(Meets("segments > 12"));
  EXPECT_TRUE(Meets("created >= 2h AND created < 30m"));
  EXPECT_TRUE(Meets("created >= \"2026-11-21 03:00:00\""));
  EXPECT_FALSE(Meets("created < 2026-11-21"));
  EXPECT_TRUE(Meets("detail = \"two words\""));
}

TEST(ListFilter, ATimeThatIsNotThereMeetsNoComparison) {
  const auto filter = ListFilter::Parse("created >= 100d", kFields, Now());
  ASSERT_TRUE(filter.ok());
  EXPECT_FALSE(filter->Meets(
      [](std::string_view) -> FieldValue { return FilterTime({}); }));
}

TEST(ListFilter, NamesWhatIsKnown) {
  EXPECT_THAT(Refusal("stat = active"),
              AllOf(HasSubstr("--filter: there is no field 'stat'"),
                    HasSubstr("did you mean 'state'?"),
                    HasSubstr("state, segments, created, detail")));
  EXPECT_THAT(Refusal("state = actife"),
              AllOf(HasSubstr("there is no state 'actife'"),
                    HasSubstr("did you mean 'active'?"),
                    HasSubstr("active, rolled-back")));
  EXPECT_THAT(Refusal("state > active"), HasSubstr("one of = !="));
  EXPECT_THAT(Refusal("segments = many"), HasSubstr("'many' is not a number"));
  EXPECT_THAT(Refusal("created = soon"), HasSubstr("created: 'soon'"));
  EXPECT_THAT(Refusal("segments ="), HasSubstr("needs a value"));
  EXPECT_THAT(Refusal("detail = \"open"), HasSubstr("needs a value"));
  EXPECT_THAT(Refusal("segments = 1 OR segments = 2"), HasSubstr("AND"));
  EXPECT_THAT(Refusal("segments = 1 AND"), HasSubstr("AND"));
}

class Lists : public Commands {
 protected:
  Lists() {
    for (const char* id : {"a", "b", "c", "d", "e"}) {
      daemon_.rigs.push_back(ToProto(ARig(id)));
    }
    for (int i = 1; i <= 5; ++i) {
      daemon_.calibrations.push_back(Version(i));
      if (i < 5) {
        daemon_.calibrations.back().set_state(v1::Calibration::REJECTED);
      }
      v1::Recalibration run;
      run.set_name("rigs/a/recalibrations/" + std::to_string(i));
      run.set_state(i == 3 ? v1::Recalibration::FAILED
                           : v1::Recalibration::SUCCEEDED);
      daemon_.run.push_back(run);
      v1::Segment segment;
      segment.set_name("rigs/a/segments/walk~" + std::to_string(i));
      daemon_.segments.push_back(segment);
    }
  }
  int Lines(const std::vector<std::string>& arguments) const {
    const Outcome outcome = Selfcal(arguments);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return static_cast<int>(
        std::count(outcome.out.begin(), outcome.out.end(), '\n'));
  }
};

TEST_F(Lists, EndAtTheLimit) {
  EXPECT_EQ(Lines({"rig", "list", "--limit", "3"}), 3);
  EXPECT_EQ(Lines({"segment", "list", "a", "--limit", "4"}), 4);
  EXPECT_EQ(Lines({"run", "list", "a", "--limit", "1"}), 1);
  EXPECT_EQ(Lines({"calibration", "list", "a", "--limit", "99"}), 5);
  EXPECT_EQ(Selfcal({"run", "list", "a", "--limit", "0"}).code, 2);
  const auto json = Parse<v1::ListRigsResponse>(
      Selfcal({"rig", "list", "--limit", "3", "--json"}).out);
  EXPECT_EQ(json.rigs_size(), 3);
  EXPECT_EQ(json.next_page_token(), "");
}

TEST_F(Lists, TheLimitIsOfThoseThatMeetTheFilter) {
  EXPECT_EQ(Lines({"calibration", "list", "a", "--filter", "state = rejected"}),
            4);
  EXPECT_EQ(Lines({"calibration",
                   "list",
                   "a",
                   "--filter",
                   "state = rejected AND version >= 2",
                   "--limit",
                   "2"}),
            2);
  EXPECT_EQ(Selfcal({"run", "list", "a", "--filter", "state = failed"}).out,
            "3\tfailed\tunknown\t-\t-\t0\t-\t\n");
  EXPECT_EQ(Lines({"run", "list", "a", "--filter", "run > 3"}), 2);
}

// The daemon tests what it can, so that the others are not sent; the program
// tests all of it.
TEST_F(Lists, HaveTheDaemonFilterAndSort) {
  Selfcal({"calibration",
           "list",
           "--filter",
           "state = rejected AND version >= 2 AND verdict != good",
           "--order-by",
           "temperature_c asc"});
  EXPECT_EQ(daemon_.last_filter, "state = REJECTED");
  EXPECT_EQ(daemon_.last_order, "temperature_c asc");
  Selfcal({"run",
           "list",
           "--filter",
           "trigger = \"tables full\" AND created >= 2026-11-21",
           "--order-by",
           "duration"});
  EXPECT_EQ(daemon_.last_filter,
            "trigger = TABLES_FULL AND create_time >= 2026-11-21T00:00:00Z");
  EXPECT_EQ(daemon_.last_order, "duration");
}

TEST_F(Lists, RefuseUnknownFieldsAndStatesWithTwo) {
  const Outcome field =
      Selfcal({"run", "list", "a", "--filter", "xstate = failed"});
  EXPECT_EQ(field.code, 2);
  EXPECT_THAT(field.err, HasSubstr("did you mean 'state'?"));
  const Outcome state =
      Selfcal({"calibration", "list", "a", "--filter", "state = activee"});
  EXPECT_EQ(state.code, 2);
  EXPECT_THAT(
      state.err,
      AllOf(HasSubstr("did you mean 'active'?"), HasSubstr("rolled-back")));
}

TEST_F(Lists, RefuseGroupsThatTheRigDoesNotHave) {
  daemon_.rigs[0].clear_groups();
  daemon_.rigs[0].add_groups()->set_group("imu");
  daemon_.rigs[0].add_groups()->set_group("camera");
  for (const std::vector<std::string>& line :
       std::vector<std::vector<std::string>>{
           {"segment", "list", "a", "--filter", "gain.camra >= 2"},
           {"segment", "list", "a", "--filter", "in_table = camra"},
           {"segment", "list", "a", "--order-by", "entropy.camra asc"},
           {"table", "show", "a", "--group", "camra"}}) {
    const Outcome outcome = Selfcal(line);
    EXPECT_EQ(outcome.code, 2) << testing::PrintToString(line);
    EXPECT_THAT(outcome.err,
                AllOf(HasSubstr("the rig has no group 'camra'"),
                      HasSubstr("did you mean 'camera'?"),
                      HasSubstr("Known: imu, camera")));
    EXPECT_THAT(outcome.err, HasSubstr(line[line.size() - 2] + ":"));
  }
  EXPECT_EQ(Lines({"segment", "list", "a", "--filter", "gain.camera >= 2"}), 5);
  EXPECT_EQ(daemon_.last_filter, "gain.camera >= 2");
}

TEST_F(Lists, ATableIsShownAlone) {
  for (const char* group : {"imu", "camera"}) {
    v1::Table* table = daemon_.tables.add_tables();
    table->set_name(std::string("rigs/z/tables/") + group);
    for (int i = 0; i < 3; ++i) {
      table->add_entries()->set_segment("rigs/z/segments/walk~" +
                                        std::to_string(i));
    }
  }
  EXPECT_EQ(Lines({"table", "show", "z"}), 6);
  EXPECT_EQ(Lines({"table", "show", "z", "--limit", "1"}), 2);
  EXPECT_EQ(
      Selfcal({"table", "show", "z", "--group", "camera", "--limit", "1"}).out,
      "camera\t1\twalk~0\t0.000000\t0.000000\n");
}

}  // namespace
}  // namespace selfcal::client
