#include "client/cli/list_csv.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <map>
#include <string>
#include <vector>

#include "selfcal/v1/fleet.pb.h"
#include "selfcal/v1/recalibration.pb.h"
#include "selfcal/v1/segment.pb.h"
#include "test/client/cli/commands_fixture.h"

namespace selfcal::client {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

using Record = std::vector<std::string>;

// RFC 4180, written anew.
std::vector<Record> Parsed(const std::string& csv) {
  std::vector<Record> records(1, Record(1));
  bool quoted = false;
  for (std::size_t k = 0; k < csv.size(); ++k) {
    std::string& cell = records.back().back();
    if (quoted) {
      if (csv[k] != '"') {
        cell += csv[k];
      } else if (k + 1 < csv.size() && csv[k + 1] == '"') {
        cell += csv[++k];
      } else {
        quoted = false;
      }
    } else if (csv[k] == '"') {
      quoted = true;
    } else if (csv[k] == ',') {
      records.back().emplace_back();
    } else if (csv.compare(k, 2, "\r\n") == 0) {
      ++k;
      records.emplace_back(1);
    } else {
      cell += csv[k];
    }
  }
  EXPECT_EQ(records.back(), Record(1)) << "the last line has an end";
  records.pop_back();
  return records;
}

std::vector<std::map<std::string, std::string>> Rows(const std::string& csv) {
  const std::vector<Record> records = Parsed(csv);
  std::vector<std::map<std::string, std::string>> rows;
  for (std::size_t r = 1; r < records.size(); ++r) {
    EXPECT_EQ(records[r].size(), records[0].size());
    for (std::size_t c = 0; c < records[0].size(); ++c) {
      rows.resize(r);
      const bool is_new =
          rows[r - 1].emplace(records[0][c], records[r].at(c)).second;
      EXPECT_TRUE(is_new) << records[0][c];
    }
  }
  return rows;
}

TEST(ListCsv, HasEveryFieldWithItsExactValue) {
  v1::ListRecalibrationsResponse list;
  v1::Recalibration* run = list.add_recalibrations();
  run->set_name("rigs/a/recalibrations/3");
  run->set_state(v1::Recalibration::FAILED);
  run->mutable_create_time()->set_seconds(1'795'234'203);
  run->set_cost(0.1 + 0.2);
  run->set_step_sigmas(-1e-300);
  run->add_segments("rigs/a/segments/s~1");
  run->add_segments("rigs/a/segments/s~2");
  run->set_message("the \"disk\", again\nand again");
  const auto rows = Rows(ListCsv(list));
  ASSERT_EQ(rows.size(), 1u);
  auto row = rows[0];
  EXPECT_EQ(row["name"], "rigs/a/recalibrations/3");
  EXPECT_EQ(row["state"], "FAILED");
  EXPECT_EQ(row["create_time"], "2026-11-21T04:10:03Z");
  EXPECT_EQ(row.at("end_time"), "");
  EXPECT_EQ(std::strtod(row["cost"].c_str(), nullptr), 0.1 + 0.2);
  EXPECT_EQ(std::strtod(row["step_sigmas"].c_str(), nullptr), -1e-300);
  EXPECT_EQ(row["segments"], "rigs/a/segments/s~1; rigs/a/segments/s~2");
  EXPECT_EQ(row["message"], "the \"disk\", again?and again");
}

TEST(ListCsv, HasAColumnForEachKeyOfAnyItem) {
  v1::ListSegmentsResponse list;
  const auto add = [](v1::Segment* segment, const char* group, double entropy) {
    auto* score = segment->add_scores();
    score->set_group(group);
    score->set_entropy_nats(entropy);
  };
  add(list.add_segments(), "imu", -3.5);
  v1::Segment* both = list.add_segments();
  add(both, "imu", -4.5);
  add(both, "camera", 2.25);
  both->set_temperature_c(0);
  auto rows = Rows(ListCsv(list));
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[0]["scores.imu.entropy_nats"], "-3.5");
  EXPECT_EQ(rows[0].at("scores.camera.entropy_nats"), "");
  EXPECT_EQ(rows[1]["scores.camera.entropy_nats"], "2.25");
  // Not there, and zero.
  EXPECT_EQ(rows[0].at("temperature_c"), "");
  EXPECT_EQ(rows[1]["temperature_c"], "0");
}

TEST(ListCsv, HasAHeaderWithoutItems) {
  const auto records = Parsed(ListCsv(v1::ListRecalibrationsResponse()));
  ASSERT_EQ(records.size(), 1u);
  EXPECT_THAT(records[0], testing::Contains("message"));
}

TEST(ListCsv, TextIsNoFormula) {
  v1::ListRecalibrationsResponse list;
  for (const char* text : {"=1+1", "+1", "-1", "@sum", "1=1", "-"}) {
    list.add_recalibrations()->set_message(text);
  }
  list.mutable_recalibrations(0)->set_cost(-1);
  auto rows = Rows(ListCsv(list));
  for (int k = 0; k < 4; ++k) {
    EXPECT_THAT(rows[k]["message"], StartsWith("'"));
  }
  EXPECT_EQ(rows[4]["message"], "1=1");
  EXPECT_EQ(rows[5]["message"], "-");
  EXPECT_EQ(rows[0]["cost"], "-1");
}

class CsvOfCommands : public Commands {};

TEST_F(CsvOfCommands, ListsHaveIt) {
  for (const char* id : {"a", "b"}) {
    daemon_.rigs.push_back(ToProto(ARig(id)));
  }
  (*daemon_.rigs[1].mutable_labels())["model"] = "t4";
  const Outcome outcome = Selfcal({"rig", "list", "--csv"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  auto rows = Rows(outcome.out);
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[0]["name"], "rigs/a");
  EXPECT_EQ(rows[0].at("labels.model"), "");
  EXPECT_EQ(rows[1]["labels.model"], "t4");
}

TEST_F(CsvOfCommands, ExcludesJson) {
  const Outcome outcome = Selfcal({"--json", "rig", "list", "--csv"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("--csv and --json exclude each other"));
  EXPECT_EQ(Selfcal({"rig", "show", "a", "--csv"}).code, 2) << "it is no list";
}

}  // namespace
}  // namespace selfcal::client
