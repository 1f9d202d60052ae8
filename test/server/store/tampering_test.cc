// What SQLite itself must refuse or notice: these reach around the store, into
// its file.
#include "test/server/store/sqlite_test.h"

namespace selfcal::server {
namespace {

class TamperingTest : public SqliteTest {
 protected:
  TamperingTest() { Reopen(); }

  void Reopen() {
    store_.reset();
    const absl::Status opened = Open();
    ASSERT_TRUE(opened.ok()) << opened;
  }

  absl::Status Execute(const std::string& sql) {
    auto db = Connection::Open(Path(), SQLITE_OPEN_READWRITE);
    EXPECT_TRUE(db.ok());
    EXPECT_TRUE(db->Execute("PRAGMA busy_timeout = 1000").ok());
    return db->Execute(sql);
  }

  // Flips one byte of a blob, around the triggers.
  void Damage(const std::string& table, const std::string& column) {
    store_.reset();
    ASSERT_TRUE(Execute("DROP TRIGGER IF EXISTS calibrations_never_change;"
                        "UPDATE " +
                        table + " SET " + column +
                        " = CAST("
                        "  substr(" +
                        column +
                        ", 1, 20) || x'5a' || "
                        "  substr(" +
                        column + ", 22) AS BLOB)")
                    .ok());
    Reopen();
  }
};

TEST_F(TamperingTest, CalibrationCannotBeChangedOrDeleted) {
  ASSERT_TRUE(domain_->CreateRig(rig_).ok());
  store_.reset();
  for (const char* sql : {"UPDATE calibrations SET content = x'00'",
                          "UPDATE calibrations SET sha256 = x'00'",
                          "UPDATE calibrations SET version = 5",
                          "UPDATE calibrations SET create_time_ns = 5",
                          "UPDATE calibrations SET state = 3",
                          "DELETE FROM calibrations",
                          "UPDATE events SET detail = ''",
                          "DELETE FROM events"}) {
    EXPECT_FALSE(Execute(sql).ok()) << sql;
  }
}

TEST_F(TamperingTest, DamagedDataIsNoticed) {
  ASSERT_TRUE(domain_->CreateRig(rig_).ok());
  ASSERT_TRUE(domain_->PutSegment("a", Segment(0)).ok());
  Damage("payloads", "data");
  const absl::Status status = store_->GetSegmentData("a", {"s", 0}).status();
  EXPECT_TRUE(absl::IsDataLoss(status)) << status;
  EXPECT_NE(std::string(status.message()).find("s~0"), std::string::npos);
}

TEST_F(TamperingTest, DamagedCalibrationIsNoticed) {
  ASSERT_TRUE(domain_->CreateRig(rig_).ok());
  Damage("calibrations", "content");
  EXPECT_TRUE(absl::IsDataLoss(store_->GetActiveCalibration("a").status()));
}

TEST_F(TamperingTest, CalibrationInAnotherRowIsNoticed) {
  ASSERT_TRUE(domain_->CreateRig(rig_).ok());
  ASSERT_TRUE(domain_->CreateRig(TestRig("b")).ok());
  store_.reset();
  ASSERT_TRUE(
      Execute("DROP TRIGGER calibrations_never_change;"
              "UPDATE calibrations SET "
              "  content = (SELECT content FROM calibrations WHERE rig = 1), "
              "  sha256 = (SELECT sha256 FROM calibrations WHERE rig = 1) "
              "WHERE rig = 2")
          .ok());
  Reopen();
  EXPECT_TRUE(store_->GetActiveCalibration("a").ok());
  EXPECT_TRUE(absl::IsDataLoss(store_->GetActiveCalibration("b").status()));
}

TEST_F(TamperingTest, DamagedRigIsNoticed) {
  ASSERT_TRUE(domain_->CreateRig(rig_).ok());
  Damage("rigs", "definition");
  EXPECT_TRUE(absl::IsDataLoss(store_->GetRig("a").status()));
}

TEST_F(TamperingTest, DamagedInformationIsNoticedAndHidesNoOther) {
  ASSERT_TRUE(domain_->CreateRig(rig_).ok());
  ASSERT_TRUE(domain_->PutSegment("a", Segment(0)).ok());
  ASSERT_TRUE(
      domain_->CommitScore("a", {"s", 0}, FakeInformation(rig_, 1.0)).ok());
  Damage("segment_information", "information");
  ASSERT_TRUE(domain_->PutSegment("a", Segment(1)).ok());
  EXPECT_TRUE(absl::IsDataLoss(store_->GetSegment("a", {"s", 0}).status()));
  const auto listed = store_->ListSegments("a", {});
  ASSERT_TRUE(listed.ok()) << listed.status();
  ASSERT_EQ(listed->items.size(), 2u);
  EXPECT_TRUE(listed->items[0].problem.empty());
  EXPECT_FALSE(listed->items[1].problem.empty());
  EXPECT_FALSE(listed->items[1].information.has_value());
}

}  // namespace
}  // namespace selfcal::server
