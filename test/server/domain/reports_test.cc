// Reports of a device to its hub: the hub has what the device has, whatever is
// lost on the way; a rig that is reported belongs to its device.
#include <cmath>
#include <random>

#include "selfcal/store/report.pb.h"
#include "server/store/change_rows.h"
#include "server/store/checksum.h"
#include "server/store/outbox.h"
#include "server/store/payload.h"
#include "server/store/records.h"
#include "server/store/report.h"
#include "test/promise.h"
#include "test/server/store/store_test.h"
#include "test/server/test_records.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr std::int64_t kLarge = std::int64_t{1} << 30;

// The store of StoreTest is that of the hub, `device_` that of the device.
class ReportsTest : public StoreTest {
 protected:
  ReportsTest() { OpenDevice(); }

  void OpenDevice(const DomainOptions& options = {}) {
    device_domain_.reset();
    device_.reset();
    auto opened = OpenSqliteStore(device_folder_->File("selfcal.db"), 0);
    ASSERT_TRUE(opened.ok()) << opened.status();
    device_ = *std::move(opened);
    device_domain_.emplace(device_.get(), options);
  }

  // A rig of the device, with small tables.
  Rig CreateDeviceRig(const std::string& id) {
    Rig rig = TestRig(id);
    rig.table_size = 3;
    EXPECT_TRUE(device_domain_->CreateRig(rig).ok());
    return rig;
  }

  void PutOnDevice(const Rig& rig, std::int64_t index) {
    const auto put = device_domain_->PutSegment(rig.id, Segment(index));
    ASSERT_TRUE(put.ok()) << put.status();
  }

  void ScoreOnDevice(const Rig& rig, std::int64_t index, double entropy) {
    const auto scored = device_domain_->CommitScore(
        rig.id,
        {"s", index},
        FakeInformation(rig, entropy, 5, static_cast<unsigned>(index)));
    ASSERT_TRUE(scored.ok()) << scored.status();
  }

  // The first run of the rig, whose candidate is not validated yet.
  void StoreCandidateOnDevice(const Rig& rig) {
    ASSERT_TRUE(device_domain_->CreateManualRun(rig.id).ok());
    ASSERT_TRUE(device_domain_->BeginRun(rig.id, 1).ok());
    StoredCalibration candidate =
        TestCalibration(rig, *device_->GetRun(rig.id, 1));
    candidate.state = CalibrationState::kCandidate;
    const auto stored = device_domain_->StoreCandidate(rig.id, 1, candidate);
    ASSERT_TRUE(stored.ok()) << stored.status();
  }

  void SetLabelOnDevice(const std::string& rig, const std::string& value) {
    const auto updated = device_domain_->UpdateRig(
        rig,
        [&](StoredRig stored) -> absl::StatusOr<StoredRig> {
          stored.labels["site"] = value;
          return stored;
        },
        "eve");
    ASSERT_TRUE(updated.ok()) << updated.status();
  }

  Report NextReport() {
    const auto report =
        device_->outbox()->Next(device_->outbox()->List()->front(), kLarge);
    EXPECT_TRUE(report.ok()) << report.status();
    return report.value_or(Report());
  }

  // What the events of a rig say: all, or those that a caller sees who may
  // read this rig alone.
  static std::vector<std::string> EventsOf(Store* store,
                                           const std::string& rig,
                                           bool is_limited = false) {
    RigQuery of;
    if (is_limited) of.choice = RigChoice{{rig}, {}};
    const auto listed = store->ListEvents({1000, ""}, rig, of);
    EXPECT_TRUE(listed.ok()) << listed.status();
    std::vector<std::string> events;
    for (const StoredEvent& event : listed->items) {
      events.push_back(std::to_string(event.time_ns) + " " + event.detail);
    }
    return events;
  }

  void ReportNewRigs(ReportedData data) {
    const auto rigs = device_->outbox()->ListUnreported();
    ASSERT_TRUE(rigs.ok()) << rigs.status();
    for (const std::string& rig : *rigs) {
      ASSERT_TRUE(device_->outbox()->BeginAnew(rig, data).ok());
    }
  }

  absl::StatusOr<ReportAnswer> Give(const Report& report) {
    return domain_->TakeReport({.rig = report.rig,
                                .key = report.key,
                                .number = report.number,
                                .attempt = report.attempt,
                                .deleted = report.deleted,
                                .records = report.records,
                                .waiting = report.waiting,
                                .program_version = "test",
                                .results = {}});
  }

  // One report of each rig that has something to report. Returns how many there
  // were; `is_lost` decides whether the answer is.
  int ReportOnce(ReportedData data,
                 std::int64_t max_bytes,
                 const std::function<bool()>& is_lost) {
    ReportNewRigs(data);
    int reports = 0;
    const auto rigs = device_->outbox()->List();
    EXPECT_TRUE(rigs.ok()) << rigs.status();
    for (const ReportedRig& rig : *rigs) {
      if (rig.waiting == 0 && !rig.deleted) continue;
      ++reports;
      const auto report = device_->outbox()->Next(rig, max_bytes);
      EXPECT_TRUE(report.ok()) << report.status();
      const auto answer = Give(*report);
      EXPECT_TRUE(answer.ok()) << answer.status();
      if (!answer.ok()) return 0;
      if (answer->attempt > 0) {
        EXPECT_TRUE(
            device_->outbox()->FollowAttempt(rig, answer->attempt).ok());
      } else if (answer->begin_anew) {
        ++anew_;
        EXPECT_TRUE(device_->outbox()->BeginAnew(rig.rig, data).ok());
      } else if (!is_lost()) {
        EXPECT_TRUE(device_->outbox()->Confirm(*report, 1).ok());
      }
    }
    return reports;
  }

  void ReportAll(ReportedData data = ReportedData::kNone,
                 std::int64_t max_bytes = kLarge) {
    while (ReportOnce(data, max_bytes, [] { return false; }) > 0) {
      if (HasFailure()) return;
    }
  }

  // Everything that a store has of a rig, read as a report from the beginning.
  static std::vector<std::string> Everything(Store* store,
                                             const std::string& rig,
                                             bool with_data) {
    const auto begun = store->outbox()->BeginAnew(
        rig, with_data ? ReportedData::kAll : ReportedData::kNone);
    EXPECT_TRUE(begun.ok()) << begun;
    std::vector<std::string> all;
    for (;;) {
      const auto rigs = store->outbox()->List();
      EXPECT_TRUE(rigs.ok()) << rigs.status();
      const auto found =
          std::find_if(rigs->begin(), rigs->end(), [&](const auto& r) {
            return r.rig == rig && !r.deleted;
          });
      if (found == rigs->end() || found->waiting == 0) return all;
      const auto report = store->outbox()->Next(*found, kLarge);
      EXPECT_TRUE(report.ok()) << report.status();
      store::ReportedRecords records;
      EXPECT_TRUE(records.ParseFromString(report->records));
      for (const auto& record : records.records()) {
        all.push_back(record.ShortDebugString());
      }
      EXPECT_TRUE(store->outbox()->Confirm(*report, 1).ok());
    }
  }

  // The records with another definition of the rig.
  static store::ReportedRecords WithDefinition(store::ReportedRecords records,
                                               const StoredRig& rig) {
    for (auto& record : *records.mutable_records()) {
      if (record.kind() != static_cast<int>(RecordKind::kRig)) continue;
      auto* row = record.mutable_rows(0);
      const std::string definition = SerializeRig(rig);
      row->mutable_values(1)->set_blob(definition);
      row->mutable_values(2)->set_blob(Sha256(definition));
    }
    return records;
  }

  // The records with another blob in the column of a table, and its checksum in
  // the next column of this type.
  static store::ReportedRecords WithBlob(store::ReportedRecords records,
                                         const std::string& table,
                                         const std::string& blob) {
    bool replaced = false;
    for (auto& record : *records.mutable_records()) {
      for (auto& row : *record.mutable_rows()) {
        if (records.tables(row.table()).name() != table) continue;
        std::vector<store::ReportedRecords::Value*> blobs;
        for (auto& value : *row.mutable_values()) {
          if (value.has_blob()) blobs.push_back(&value);
        }
        EXPECT_EQ(blobs.size(), 2u);
        blobs[0]->set_blob(blob);
        blobs[1]->set_blob(Sha256(blob));
        replaced = true;
      }
    }
    EXPECT_TRUE(replaced) << table;
    return records;
  }

  static void SetInteger(const std::string& table,
                         const std::string& column,
                         std::int64_t value,
                         store::ReportedRecords* records) {
    bool is_set = false;
    for (auto& record : *records->mutable_records()) {
      for (auto& row : *record.mutable_rows()) {
        const auto& of = records->tables(row.table());
        for (int c = 0; of.name() == table && c < of.columns_size(); ++c) {
          if (of.columns(c) != column) continue;
          row.mutable_values(c)->set_integer(value);
          is_set = true;
        }
      }
    }
    EXPECT_TRUE(is_set) << table << "." << column;
  }

  void ExpectSame(const std::string& rig, bool with_data = false) {
    const auto device = Everything(device_.get(), rig, with_data);
    const auto hub = Everything(store_.get(), rig, with_data);
    ASSERT_EQ(device.size(), hub.size());
    for (std::size_t k = 0; k < device.size(); ++k) {
      ASSERT_EQ(device[k], hub[k]) << "record " << k;
    }
  }

  std::optional<TempFolder> device_folder_{std::in_place};
  std::unique_ptr<Store> device_;
  std::optional<Domain> device_domain_;
  int anew_ = 0;  // how often the device had to begin anew
};
SELFCAL_STORE_TEST_SUITE(ReportsTest);

TEST_P(ReportsTest, HubHasWhatTheDeviceHas) {
  const Rig rig = CreateDeviceRig("a");
  for (int k = 0; k < 5; ++k) {
    PutOnDevice(rig, k);
    if (k < 4) ScoreOnDevice(rig, k, 3.0 - k);
  }
  ReportAll();
  ExpectSame("a");
  const auto tables = store_->GetTables("a");
  ASSERT_TRUE(tables.ok()) << tables.status();
  EXPECT_EQ((*tables)[0].entries.size(), 3u);
  EXPECT_EQ(store_->GetActiveCalibration("a")->version, 1);
  EXPECT_EQ(store_->GetRig("a")->create_time_ns,
            device_->GetRig("a")->create_time_ns);
  // The hub computes nothing of it.
  EXPECT_THAT(*store_->ListUnscored(10), IsEmpty());
  EXPECT_THAT(*store_->ListUnfinishedRuns(), IsEmpty());
  EXPECT_EQ(store_->CountWork()->segments, 0);
  EXPECT_EQ(store_->CountWork()->runs, 0);
  EXPECT_THAT(*store_->FindBusyRigs({"a"}), IsEmpty());
  EXPECT_THAT(*domain_->StartTimedRuns(NowNs()), IsEmpty());
  EXPECT_THAT(*domain_->StartSessionRuns({}, NowNs()), IsEmpty());
  for (const RigCheck check : {RigCheck::kTime, RigCheck::kSession}) {
    EXPECT_THAT(*store_->ListRigsToCheck(check, kNoCheck - 1, 10), IsEmpty());
  }
  EXPECT_FALSE(HasData("a", 4));
}

TEST_P(ReportsTest, WhatChangesLaterFollows) {
  const Rig rig = CreateDeviceRig("a");
  ReportAll();
  PutOnDevice(rig, 0);
  ScoreOnDevice(rig, 0, 1.0);
  ASSERT_TRUE(device_domain_
                  ->UpdateRig(
                      "a",
                      [](StoredRig stored) -> absl::StatusOr<StoredRig> {
                        stored.labels["model"] = "t4";
                        return stored;
                      },
                      "eve")
                  .ok());
  const auto before = device_->outbox()->List();
  ASSERT_THAT(*before, SizeIs(1));
  // The rig, its tables, a segment, an event: each once.
  EXPECT_EQ(before->front().waiting, 4);
  ReportAll();
  EXPECT_EQ(store_->GetRig("a")->labels.at("model"), "t4");
  ExpectSame("a");
}

TEST_P(ReportsTest, ReportThatComesTwiceChangesNothing) {
  const Rig rig = CreateDeviceRig("a");
  PutOnDevice(rig, 0);
  ReportNewRigs(ReportedData::kNone);
  const auto report =
      device_->outbox()->Next(device_->outbox()->List()->front(), kLarge);
  ASSERT_TRUE(report.ok()) << report.status();
  for (int k = 0; k < 2; ++k) {
    const auto answer = Give(*report);
    ASSERT_TRUE(answer.ok()) << answer.status();
    EXPECT_FALSE(answer->begin_anew);
  }
  ASSERT_TRUE(device_->outbox()->Confirm(*report, 1).ok());
  ExpectSame("a");
}

TEST_P(ReportsTest, HubThatHasLostRecordsIsToldAllOfThem) {
  const Rig rig = CreateDeviceRig("a");
  PutOnDevice(rig, 0);
  ReportAll();
  // As after a restore of an older backup.
  ASSERT_TRUE(domain_->DeleteRig("a", "eve", "trial").ok());
  PutOnDevice(rig, 1);
  ReportAll();
  EXPECT_EQ(anew_, 1);
  // Its events outlive a rig, also that of this deletion.
  EXPECT_THAT(store_->ListSegments("a", Page())->items, SizeIs(2));
}

TEST_P(ReportsTest, HubThatMissesOneReportIsToldAllOfThem) {
  const Rig rig = CreateDeviceRig("a");
  ReportAll();
  PutOnDevice(rig, 0);
  // Confirmed, but the hub does not have it: it was restored from a backup.
  const auto lost =
      device_->outbox()->Next(device_->outbox()->List()->front(), kLarge);
  ASSERT_TRUE(lost.ok()) << lost.status();
  ASSERT_TRUE(device_->outbox()->Confirm(*lost, 1).ok());
  PutOnDevice(rig, 1);
  ReportAll();
  EXPECT_EQ(anew_, 1);
  ExpectSame("a");
}

TEST_P(ReportsTest, DeviceChangesAreReported) {
  CreateDeviceRig("a");
  ReportAll();
  StoredChange change;
  change.rig = "a";
  change.change = 1;
  change.base_version = 1;
  change.first_sequence = 1;
  change.groups = {"imu", "camera"};
  const absl::Status inserted = device_->Transact(
      "a", 1, [&](UnitOfWork* tx) { return InsertChange(tx, change); });
  ASSERT_TRUE(inserted.ok()) << inserted;
  ReportAll();
  EXPECT_EQ(anew_, 0);
  const auto reported = store_->GetChange("a", 1);
  ASSERT_TRUE(reported.ok()) << reported.status();
  EXPECT_EQ(reported->groups, change.groups);
  ExpectSame("a");
}

TEST_P(ReportsTest, NothingToReportIsAnEmptyReport) {
  CreateDeviceRig("a");
  ReportAll();
  const auto report =
      device_->outbox()->Next(device_->outbox()->List()->front(), kLarge);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->records, "");
  EXPECT_TRUE(Give(*report).ok());
}

TEST_P(ReportsTest, DeletionOfARigThatTheHubDoesNotHaveIsTaken) {
  CreateTestRig("own");
  for (const char* id : {"unseen", "own", "missed"}) {
    const Rig rig = CreateDeviceRig(id);
    PutOnDevice(rig, 0);
    ReportNewRigs(ReportedData::kNone);
    if (rig.id == "missed") {
      // The hub took the first report, and lost the second one.
      ASSERT_TRUE(
          Give(*device_->outbox()->Next(device_->outbox()->List()->front(), 1))
              .ok());
      for (int k = 0; k < 2; ++k) {
        ASSERT_TRUE(device_->outbox()
                        ->Confirm(*device_->outbox()->Next(
                                      device_->outbox()->List()->front(), 1),
                                  1)
                        .ok());
      }
    }
    ASSERT_TRUE(device_domain_->DeleteRig(id, "eve", "sold").ok());
    ReportAll();
    EXPECT_THAT(*device_->outbox()->List(), IsEmpty()) << id;
  }
  EXPECT_EQ(anew_, 0);
  EXPECT_TRUE(store_->GetRig("own").ok());
  EXPECT_TRUE(absl::IsNotFound(store_->GetRig("missed").status()));
}

TEST_P(ReportsTest, SegmentsDeletedWhileNothingWasReportedAreGoneAtTheHub) {
  const Rig rig = CreateDeviceRig("a");
  for (int k = 0; k < 4; ++k) PutOnDevice(rig, k);
  ReportAll();
  ASSERT_TRUE(device_->outbox()->Close().ok());
  for (const int k : {1, 3}) {
    ASSERT_TRUE(
        device_domain_->DeleteSegment("a", {"s", k}, "eve", "private").ok());
  }
  ReportAll();
  EXPECT_THAT(store_->ListSegments("a", Page())->items, SizeIs(2));
  ExpectSame("a");
}

TEST_P(ReportsTest, NumberOfADeletedSegmentMayBeTakenByAnother) {
  const Rig rig = CreateDeviceRig("a");
  PutOnDevice(rig, 0);
  PutOnDevice(rig, 1);
  ReportAll(ReportedData::kAll);
  EXPECT_TRUE(HasData("a", 1));
  ASSERT_TRUE(
      device_domain_->DeleteSegment("a", {"s", 1}, "eve", "private").ok());
  PutOnDevice(rig, 2);
  ReportAll(ReportedData::kAll);
  EXPECT_TRUE(absl::IsNotFound(store_->GetSegment("a", {"s", 1}).status()));
  EXPECT_TRUE(HasData("a", 2));
  ExpectSame("a", true);
}

// The newest segment of the hub need not be that of the device.
TEST_P(ReportsTest, RivalThatIsDeletedIsTheSameAtTheHub) {
  const Rig rig = CreateDeviceRig("a");
  const int rival = rig.table_size;
  for (int k = 0; k <= rival; ++k) {
    PutOnDevice(rig, k);
    ScoreOnDevice(rig, k, -k);
  }
  ReportAll();
  const auto exclusions = store_->ListExclusions("a", {"s", 0});
  ASSERT_TRUE(exclusions.ok()) << exclusions.status();
  ASSERT_FALSE(exclusions->empty());
  EXPECT_EQ(exclusions->front().rival, (SegmentKey{"s", rival}));
  // It is reported in the place of the first change, before the next one.
  ASSERT_TRUE(
      device_domain_->QuarantineSegments("a", "s", rival, "eve", "x").ok());
  PutOnDevice(rig, rival + 1);
  ASSERT_TRUE(
      device_domain_->DeleteSegment("a", {"s", rival}, "eve", "private").ok());
  ReportAll();
  ExpectSame("a");
}

TEST_P(ReportsTest, NewestSegmentsMayComeAgainInAnotherOrder) {
  for (const bool anew : {false, true}) {
    const std::string id = anew ? "a" : "b";
    const Rig rig = CreateDeviceRig(id);
    for (int k = 0; k < 4; ++k) PutOnDevice(rig, k);
    ReportAll();
    if (anew) {
      ASSERT_TRUE(device_->outbox()->Close().ok());
    }
    for (const int k : {3, 2}) {
      ASSERT_TRUE(
          device_domain_->DeleteSegment(id, {"s", k}, "eve", "private").ok());
    }
    for (const int k : {3, 2}) PutOnDevice(rig, k);
    ReportAll();
    ExpectSame(id);
  }
}

TEST_P(ReportsTest, DelayedReportDoesNotReplaceNewerRecords) {
  CreateDeviceRig("a");
  // Number 1, and a later one.
  for (const std::int64_t number : {1, 2}) {
    if (number == 1) ReportNewRigs(ReportedData::kNone);
    SetLabelOnDevice("a", "north");
    const Report delayed = NextReport();
    ASSERT_EQ(delayed.number, number);
    SetLabelOnDevice("a", "south");
    const Report newer = NextReport();
    ASSERT_EQ(newer.number, number);
    ASSERT_TRUE(Give(newer).ok());
    EXPECT_TRUE(Give(delayed).ok());
    EXPECT_EQ(store_->GetRig("a")->labels.at("site"), "south");
    ASSERT_TRUE(device_->outbox()->Confirm(newer, 1).ok());
    ExpectSame("a");
    ReportAll();
  }
  EXPECT_EQ(anew_, 0);
}

TEST_P(ReportsTest, DeviceThatWasRestoredFollowsItsLaterAttempts) {
  CreateDeviceRig("a");
  for (const char* label : {"x", "y", "z"}) {
    SetLabelOnDevice("a", label);
    ReportAll();
  }
  // It counts its attempts from 1 again.
  ASSERT_TRUE(device_->outbox()->Close().ok());
  SetLabelOnDevice("a", "north");
  ReportAll();
  EXPECT_EQ(store_->GetRig("a")->labels.at("site"), "north");
  SetLabelOnDevice("a", "south");
  ReportAll();
  EXPECT_EQ(store_->GetRig("a")->labels.at("site"), "south");
  EXPECT_EQ(anew_, 0);
}

// The first report was on its way for long, and nobody waits for its answer.
TEST_P(ReportsTest, DelayedFirstReportDoesNotBringADeletedRigBack) {
  for (const bool is_known : {false, true}) {
    const std::string id = is_known ? "known" : "unknown";
    CreateDeviceRig(id);
    ReportNewRigs(ReportedData::kNone);
    const Report delayed = NextReport();
    ASSERT_EQ(delayed.number, 1);
    if (is_known) ReportAll();
    ASSERT_TRUE(device_domain_->DeleteRig(id, "eve", "sold").ok());
    ReportAll();
    ASSERT_TRUE(absl::IsNotFound(store_->GetRig(id).status()));
    const auto late = Give(delayed);
    ASSERT_TRUE(late.ok()) << late.status();
    EXPECT_GT(late->attempt, delayed.attempt);
    EXPECT_TRUE(absl::IsNotFound(store_->GetRig(id).status()));
    // Another rig of the name has another key.
    CreateDeviceRig(id);
    ReportAll();
    ExpectSame(id);
    ASSERT_TRUE(device_domain_->DeleteRig(id, "eve", "the next one").ok());
    ReportAll();
  }
  EXPECT_EQ(anew_, 0);
}

// It was restored from a backup of before the deletion.
TEST_P(ReportsTest, DeviceThatHasTheDeletedRigAgainReportsIt) {
  CreateDeviceRig("a");
  ReportNewRigs(ReportedData::kNone);
  Report first = NextReport();
  ASSERT_TRUE(device_domain_->DeleteRig("a", "eve", "a mistake").ok());
  ReportAll();
  const auto late = Give(first);
  ASSERT_TRUE(late.ok()) << late.status();
  first.attempt = late->attempt + 1;
  for (int k = 0; k < 2; ++k) {
    const auto answer = Give(first);
    ASSERT_TRUE(answer.ok()) << answer.status();
    EXPECT_EQ(answer->attempt, 0);
    EXPECT_TRUE(store_->GetRig("a").ok());
  }
}

TEST_P(ReportsTest, DeletionIsForgottenWhenNoReportCanBeOnItsWay) {
  CreateDeviceRig("a");
  ReportNewRigs(ReportedData::kNone);
  const Report first = NextReport();
  ASSERT_TRUE(device_domain_->DeleteRig("a", "eve", "sold").ok());
  ReportAll();
  for (const std::int64_t days : {6, 8}) {
    ASSERT_TRUE(store_
                    ->EndReports(first.key + days,
                                 1,
                                 NowNs() + days * 24 * 3600 * 1'000'000'000)
                    .ok());
    const auto late = Give(first);
    ASSERT_TRUE(late.ok()) << late.status();
    EXPECT_EQ(late->attempt == 0, days == 8);
  }
}

TEST_P(ReportsTest, DeviceThatDoesNotCountItsAttemptsIsTaken) {
  CreateDeviceRig("a");
  ReportAll();
  for (const char* label : {"north", "south"}) {
    SetLabelOnDevice("a", label);
    Report report = NextReport();
    report.attempt = 0;
    const auto answer = Give(report);
    ASSERT_TRUE(answer.ok()) << answer.status();
    EXPECT_FALSE(answer->begin_anew);
    ASSERT_TRUE(device_->outbox()->Confirm(report, 1).ok());
    EXPECT_EQ(store_->GetRig("a")->labels.at("site"), label);
  }
}

TEST_P(ReportsTest, DeletionDuringAReportIsToldWithItsEvent) {
  const Rig rig = CreateDeviceRig("a");
  ReportAll();
  PutOnDevice(rig, 0);
  const Report report = NextReport();
  ASSERT_TRUE(Give(report).ok());
  ASSERT_TRUE(device_domain_->DeleteRig("a", "eve", "sold").ok());
  ASSERT_TRUE(device_->outbox()->Confirm(report, 1).ok());
  ReportAll();
  EXPECT_TRUE(absl::IsNotFound(store_->GetRig("a").status()));
  EXPECT_EQ(EventsOf(store_.get(), "a"), EventsOf(device_.get(), "a"));
}

TEST_P(ReportsTest, EventsOfADeviceFollowThoseOfAnEarlierOneOfItsName) {
  const Rig rig = CreateDeviceRig("a");
  PutOnDevice(rig, 0);
  for (const char* label : {"x", "y", "z"}) SetLabelOnDevice("a", label);
  ReportAll();
  const auto earlier = EventsOf(device_.get(), "a");
  ASSERT_THAT(earlier, SizeIs(5));
  // The device gets a new database.
  ASSERT_TRUE(domain_->DeleteRig("a", "eve", "repaired").ok());
  device_folder_.emplace();
  OpenDevice();
  CreateDeviceRig("a");
  for (int k = 0; k < 7; ++k) {
    SetLabelOnDevice("a", std::to_string(k));
    ReportAll();
  }
  const auto expect_all = [&] {
    const auto later = EventsOf(device_.get(), "a");
    EXPECT_THAT(later, SizeIs(9));
    auto all = earlier;
    all.insert(all.end(), later.begin(), later.end());
    EXPECT_EQ(EventsOf(store_.get(), "a"), all);
    EXPECT_EQ(EventsOf(store_.get(), "a", true), later);
  };
  expect_all();
  // All events are reported again.
  ASSERT_TRUE(device_->outbox()->Close().ok());
  ReportAll();
  expect_all();
}

TEST_P(ReportsTest, RigThatComesBackHasAllItsEvents) {
  CreateDeviceRig("a");
  ReportAll();
  ASSERT_TRUE(domain_->DeleteRig("a", "eve", "trial").ok());
  SetLabelOnDevice("a", "north");
  ReportAll();
  EXPECT_EQ(EventsOf(store_.get(), "a", true), EventsOf(device_.get(), "a"));
}

TEST_P(ReportsTest, EventsOfAnEarlierRigAreNotReportedAsThoseOfALaterOne) {
  CreateDeviceRig("a");
  ASSERT_TRUE(device_domain_->DeleteRig("a", "eve", "sold").ok());
  CreateDeviceRig("a");
  ReportAll();
  EXPECT_EQ(EventsOf(store_.get(), "a"), EventsOf(device_.get(), "a", true));
  EXPECT_THAT(EventsOf(store_.get(), "a"), SizeIs(2));
}

TEST_P(ReportsTest, LabelsAreThoseOfTheDefinition) {
  CreateDeviceRig("a");
  SetLabelOnDevice("a", "north");
  ReportNewRigs(ReportedData::kNone);
  Report report = NextReport();
  store::ReportedRecords records;
  ASSERT_TRUE(records.ParseFromString(report.records));
  ASSERT_EQ(records.records(0).rows_size(), 2);
  records.mutable_records(0)->mutable_rows(1)->mutable_values(1)->set_text(
      "south");
  report.records = records.SerializeAsString();
  ASSERT_TRUE(Give(report).ok());
  EXPECT_THAT(store_->ListRigs({.labels = {{"site", "south"}}}, {})->items,
              IsEmpty());
  EXPECT_THAT(store_->ListRigs({.labels = {{"site", "north"}}}, {})->items,
              SizeIs(1));
}

TEST_P(ReportsTest, DeletedRigIsDeletedAtTheHubAndItsEventsRemain) {
  const Rig rig = CreateDeviceRig("a");
  PutOnDevice(rig, 0);
  ReportAll();
  ASSERT_TRUE(device_domain_->DeleteRig("a", "eve", "sold").ok());
  // Another rig may have its name by then.
  CreateDeviceRig("a");
  ReportAll();
  EXPECT_THAT(store_->ListSegments("a", Page())->items, IsEmpty());
  EXPECT_TRUE(store_->GetRig("a").ok());
  bool told = false;
  const auto events = store_->ListEvents({100, ""}, "a");
  for (const StoredEvent& event : events->items) {
    told |= event.kind == EventKind::kRigDeleted &&
            event.detail.find("sold") != std::string::npos;
  }
  EXPECT_TRUE(told);
  ExpectSame("a");
  ASSERT_TRUE(device_domain_->DeleteRig("a", "eve", "sold again").ok());
  ReportAll();
  EXPECT_TRUE(absl::IsNotFound(store_->GetRig("a").status()));
  EXPECT_THAT(*device_->outbox()->List(), IsEmpty());
}

TEST_P(ReportsTest, RigOfADeviceCannotBeChangedAtTheHub) {
  const Rig rig = CreateDeviceRig("a");
  PutOnDevice(rig, 0);
  ScoreOnDevice(rig, 0, 1.0);
  PutOnDevice(rig, 1);
  StoreCandidateOnDevice(rig);
  ReportAll();
  const auto same = [](const StoredRig& stored) -> absl::StatusOr<StoredRig> {
    return stored;
  };
  const SegmentKey scored = {"s", 0};
  const SegmentKey unscored = {"s", 1};
  const SegmentInformation score = FakeInformation(rig, 1.0);
  const StoredCalibration result =
      TestCalibration(rig, *store_->GetRun("a", 1));
  for (const absl::Status& status :
       {domain_->PutSegment("a", Segment(2)).status(),
        domain_->CommitScore("a", unscored, score).status(),
        domain_->ReplaceScore("a", 1, scored, score, {}),
        domain_->MarkUnusable("a", scored, "x"),
        domain_->DeferRun("a", 1, "x"),
        domain_->BeginRun("a", 1).status(),
        domain_->ReleaseRun("a", 1).status(),
        domain_->StoreCandidate("a", 1, result).status(),
        domain_->FinishRun("a", 1, result).status(),
        domain_->EndRun("a", 1, RunState::kCancelled, "x").status(),
        domain_->ReportDisagreement("a", 1, "x"),
        domain_->UpdateRig("a", same, "eve").status(),
        domain_->DeleteSegment("a", {"s", 0}, "eve", "x").status(),
        domain_->QuarantineSegments("a", "s", 0, "eve", "x").status(),
        domain_->ActivateCalibration("a", 1, "eve", "x").status(),
        domain_->CreateManualRun("a", true).status()}) {
    EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr("by its device"));
  }
  const auto started = domain_->StartSessionRuns({"a"}, NowNs());
  ASSERT_TRUE(started.ok()) << started.status();
  EXPECT_THAT(*started, IsEmpty());
  ExpectSame("a");
}

TEST_P(ReportsTest, RunThatIsCancelledAtTheHubContinuesOnTheDevice) {
  const Rig rig = CreateDeviceRig("a");
  PutOnDevice(rig, 0);
  ScoreOnDevice(rig, 0, 1.0);
  StoreCandidateOnDevice(rig);
  ReportAll();
  const auto cancelled =
      domain_->EndRun("a", 1, RunState::kCancelled, "cancelled on request");
  EXPECT_TRUE(absl::IsFailedPrecondition(cancelled.status()))
      << cancelled.status();
  const auto finished = device_domain_->FinishRun(
      "a", 1, TestCalibration(rig, *device_->GetRun("a", 1)));
  ASSERT_TRUE(finished.ok()) << finished.status();
  ReportAll();
  EXPECT_EQ(anew_, 0);
  EXPECT_EQ(store_->GetActiveCalibration("a")->version, 2);
  ExpectSame("a");
}

TEST_P(ReportsTest, InstructionStaysUntilTheDeviceHasToldItsResult) {
  CreateTestRig("own");
  EXPECT_TRUE(absl::IsFailedPrecondition(
      domain_->CreateInstruction("own", "eve", "x").status()));
  CreateDeviceRig("a");
  ReportAll();
  for (const char* request : {"first", "second"}) {
    const auto given = domain_->CreateInstruction("a", "eve", request);
    ASSERT_TRUE(given.ok()) << given.status();
  }
  DeviceReport report;
  report.rig = "a";
  report.number = 2;
  report.key = device_->outbox()->List()->front().key;
  for (int k = 0; k < 2; ++k) {
    const auto answer = domain_->TakeReport(report);
    ASSERT_TRUE(answer.ok()) << answer.status();
    ASSERT_THAT(answer->instructions, SizeIs(2));
    EXPECT_EQ(answer->instructions[0].request, "first");
    EXPECT_EQ(answer->instructions[0].caller, "eve");
  }
  report.results = {{1, false, ""}, {2, true, "why"}, {3, true, "unknown"}};
  EXPECT_THAT(domain_->TakeReport(report)->instructions, IsEmpty());
  const auto listed = store_->ListInstructions("a", {});
  ASSERT_TRUE(listed.ok()) << listed.status();
  ASSERT_THAT(listed->items, SizeIs(2));
  EXPECT_EQ(listed->items[0].state, InstructionState::kRefused);
  EXPECT_EQ(listed->items[0].message, "why");
  EXPECT_GT(listed->items[0].end_time_ns, 0);
  EXPECT_EQ(listed->items[1].state, InstructionState::kDone);
}

TEST_P(ReportsTest, RigsOfTheHubAndOfOtherDevicesAreSafe) {
  CreateTestRig("own");
  CreateDeviceRig("own");
  CreateDeviceRig("a");
  ReportNewRigs(ReportedData::kNone);
  std::vector<Report> reports;
  const auto rigs = device_->outbox()->List();
  for (const ReportedRig& rig : *rigs) {
    reports.push_back(*device_->outbox()->Next(rig, kLarge));
  }
  ASSERT_THAT(reports, SizeIs(2));
  EXPECT_TRUE(Give(reports[0]).ok());
  const auto own = Give(reports[1]);
  EXPECT_TRUE(absl::IsFailedPrecondition(own.status())) << own.status();
  Report of_another = reports[0];
  ++of_another.key;
  const auto another = Give(of_another);
  EXPECT_TRUE(absl::IsFailedPrecondition(another.status())) << another.status();
  EXPECT_THAT(std::string(another.status().message()), HasSubstr("another"));
}

TEST_P(ReportsTest, WhatIsNoReportIsRefusedAndChangesNothing) {
  const Rig rig = CreateDeviceRig("a");
  PutOnDevice(rig, 0);
  ScoreOnDevice(rig, 0, 1.0);
  ReportNewRigs(ReportedData::kAll);
  const Report report =
      *device_->outbox()->Next(device_->outbox()->List()->front(), kLarge);
  store::ReportedRecords good;
  ASSERT_TRUE(good.ParseFromString(report.records));
  const auto give = [&](const store::ReportedRecords& records) {
    Report bad = report;
    bad.records = records.SerializeAsString();
    return Give(bad).status();
  };
  std::vector<store::ReportedRecords> bad;
  bad.emplace_back();  // without the rig
  bad.emplace_back(good).mutable_tables(0)->set_name("claims");
  bad.emplace_back(good).mutable_tables(0)->set_columns(
      0, "create_time_ns = 0; DROP TABLE rigs; --");
  bad.emplace_back(good).mutable_records(0)->set_kind(99);
  bad.emplace_back(good).mutable_records(0)->mutable_rows(0)->set_table(-1);
  bad.emplace_back(good).mutable_records(0)->mutable_rows(0)->clear_values();
  bad.emplace_back(good)
      .mutable_records(0)
      ->mutable_rows(0)
      ->mutable_values(0)
      ->set_text("x");
  // Each blob damaged, with and without its checksum.
  for (int r = 0; r < good.records_size(); ++r) {
    for (int k = 0; k < good.records(r).rows_size(); ++k) {
      const auto& row = good.records(r).rows(k);
      for (int v = 0; v < row.values_size(); ++v) {
        if (!row.values(v).has_blob()) continue;
        auto* value = bad.emplace_back(good)
                          .mutable_records(r)
                          ->mutable_rows(k)
                          ->mutable_values(v);
        value->mutable_blob()->insert(0, "\xff\xff");
      }
    }
  }
  // A definition that no daemon would have accepted, with its checksum.
  Rig invalid = rig;
  invalid.pixel_sigma_px = std::nan("");
  bad.push_back(WithDefinition(good, {invalid, 0}));
  invalid = rig;
  invalid.table_size = -1;
  bad.push_back(WithDefinition(good, {invalid, 0}));
  for (const auto& [name, value] :
       {std::pair("Site", "north"), std::pair("site", "no\nrth")}) {
    StoredRig labelled{rig, 0};
    labelled.labels[name] = value;
    bad.push_back(WithDefinition(good, labelled));
  }
  EXPECT_GT(bad.size(), 16u);
  for (std::size_t k = 0; k < bad.size(); ++k) {
    const absl::Status status = give(bad[k]);
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << k << ": " << status;
    EXPECT_TRUE(absl::IsNotFound(store_->GetRig("a").status())) << k;
  }
  EXPECT_TRUE(give(good).ok());
}

// Intact records that no daemon would have written: what reads them would read
// beyond their ends.
TEST_P(ReportsTest, RecordsThatDoNotFitTheRigAreRefusedAndChangeNothing) {
  const Rig rig = CreateDeviceRig("a");
  const MotionSegment segment = Segment(0);
  PutOnDevice(rig, 0);
  ScoreOnDevice(rig, 0, 1.0);
  ReportNewRigs(ReportedData::kAll);
  const Report report =
      *device_->outbox()->Next(device_->outbox()->List()->front(), kLarge);
  store::ReportedRecords good;
  ASSERT_TRUE(good.ParseFromString(report.records));

  const StoredCalibration factory = *device_->GetCalibration("a", 1);
  std::vector<StoredCalibration> calibrations;
  calibrations.emplace_back(factory).theta.cameras.clear();
  calibrations.emplace_back(factory).theta.cameras.push_back(
      factory.theta.cameras[0]);
  calibrations.emplace_back(factory).covariance.resize(0, 0);
  calibrations.emplace_back(factory).covariance =
      Eigen::MatrixXd::Identity(3, 3);
  calibrations.emplace_back(factory).covariance(0, 0) = std::nan("");
  calibrations.emplace_back(factory).theta.cameras[0].width_px = 1;

  std::vector<SegmentInformation> information;
  const SegmentInformation scored = FakeInformation(rig, 1.0);
  information.emplace_back(scored).Lambda = Eigen::MatrixXd::Identity(3, 3);
  information.emplace_back(scored).eta = Eigen::VectorXd::Ones(3);
  information.emplace_back(scored).eta(0) = INFINITY;
  information.emplace_back(scored).theta0.cameras.push_back(
      rig.factory.cameras[0]);

  std::vector<MotionSegment> segments;
  segments.emplace_back(segment).observations[0].keyframe = 100'000'000;
  segments.emplace_back(segment).observations[0].camera = 1;
  segments.emplace_back(segment).keyframes[1].p_GI.x() = std::nan("");

  std::vector<store::ReportedRecords> bad;
  for (const StoredCalibration& calibration : calibrations) {
    bad.push_back(
        WithBlob(good, "calibrations", SerializeCalibration(calibration)));
  }
  for (const SegmentInformation& one : information) {
    bad.push_back(WithBlob(good,
                           "segment_information",
                           SerializeInformationOf("a", segment.key, one)));
  }
  for (const auto& [table, column] :
       {std::pair("rigs", "create_time_ns"),
        std::pair("segments", "receive_time_ns")}) {
    SetInteger(table, column, -1, &bad.emplace_back(good));
  }
  for (std::size_t k = 0; k < bad.size(); ++k) {
    Report one = report;
    one.records = bad[k].SerializeAsString();
    const absl::Status status = Give(one).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << k << ": " << status;
    EXPECT_TRUE(absl::IsNotFound(store_->GetRig("a").status())) << k;
  }
  EXPECT_TRUE(Give(report).ok());
  // Later, the rig keeps its sensors.
  Rig other = rig;
  other.factory.cameras.push_back(other.factory.cameras[0]);
  Report later = report;
  later.number += 1;
  later.records = WithDefinition(good, {other, 0}).SerializeAsString();
  EXPECT_TRUE(Give(later)->begin_anew);
  later.number = 1;
  const absl::Status changed = Give(later).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(changed)) << changed;
  EXPECT_EQ(store_->GetRig("a")->rig.factory.cameras.size(), 1u);
  // Data is checked where it is read.
  EXPECT_TRUE(store_->GetSegmentData("a", segment.key).ok());
  for (const MotionSegment& one : segments) {
    const auto packed = PackSegment(one);
    ASSERT_TRUE(packed.ok()) << packed.status();
    store::ReportedRecords with_it = WithBlob(good, "payloads", packed->data);
    SetInteger("payloads", "raw_bytes", packed->raw_bytes, &with_it);
    later.records = with_it.SerializeAsString();
    const auto given = Give(later);
    EXPECT_TRUE(given.ok()) << given.status();
    const absl::Status read = store_->GetSegmentData("a", segment.key).status();
    EXPECT_TRUE(absl::IsDataLoss(read)) << read;
    EXPECT_THAT(std::string(read.message()),
                HasSubstr("not that of a segment"));
  }
}

// The hub would refuse it, and all that follows.
TEST_P(ReportsTest, WhatIsDamagedOfASegmentHoldsUpNothing) {
  const Rig rig = CreateDeviceRig("a");
  PutOnDevice(rig, 0);
  ScoreOnDevice(rig, 0, 1.0);
  device_domain_.reset();
  device_.reset();
  for (const auto& [table, column] :
       {std::pair("segment_information", "information"),
        std::pair("segment_paths", "path"),
        std::pair("payloads", "data")}) {
    ASSERT_TRUE(
        DamageColumn(device_folder_->File("selfcal.db"), table, column).ok());
  }
  OpenDevice();
  PutOnDevice(rig, 1);
  ScoreOnDevice(rig, 1, 2.0);
  ReportAll(ReportedData::kAll);
  EXPECT_FALSE(store_->GetSegmentData("a", {"s", 0}).ok());
  EXPECT_TRUE(store_->GetSegmentData("a", {"s", 1}).ok());
  const auto damaged = store_->GetSegment("a", {"s", 0});
  ASSERT_TRUE(damaged.ok()) << damaged.status();
  EXPECT_FALSE(damaged->information);
  const auto sound = store_->GetSegment("a", {"s", 1});
  ASSERT_TRUE(sound.ok()) << sound.status();
  EXPECT_TRUE(sound->information);
}

TEST_P(ReportsTest, DataThatIsAllReportedStaysUntilThen) {
  DomainOptions options;
  const std::int64_t bytes = static_cast<std::int64_t>(
      PackNewSegment(Segment(0))->payload.data.size());
  options.quotas.max_unreported_bytes_per_rig = 40 * bytes;
  OpenDevice(options);
  const Rig rig = CreateDeviceRig("a");
  ReportAll(ReportedData::kAll);
  // None enters a table.
  const int count = kReserve + 30;
  for (int k = 0; k < count; ++k) {
    PutOnDevice(rig, k);
    const auto scored = device_domain_->CommitScore(
        "a", {"s", k}, FakeInformation(rig, 99, 0, 1));
    ASSERT_TRUE(scored.ok()) << scored.status();
  }
  const auto data_of = [&](int k) {
    return device_->GetSegmentData("a", {"s", k}).ok();
  };
  // The oldest has made room, and an event says so.
  const bool is_full = count > 40;
  EXPECT_EQ(data_of(0), !is_full);
  EXPECT_TRUE(data_of(count - 1));
  bool told = false;
  const auto events = device_->ListEvents({1000, ""}, "a");
  for (const StoredEvent& event : events->items) {
    told |= event.detail.find("is not reported") != std::string::npos;
  }
  EXPECT_EQ(told, is_full);
  ReportAll(ReportedData::kAll);
  EXPECT_TRUE(HasData("a", count - 1));
  // It is not needed any more once the next segment was scored.
  PutOnDevice(rig, count);
  ASSERT_TRUE(
      device_domain_
          ->CommitScore("a", {"s", count}, FakeInformation(rig, 99, 0, 1))
          .ok());
  EXPECT_FALSE(data_of(count - kReserve - 1));
}

TEST_P(ReportsTest, HubKeepsTheDataWithinItsQuota) {
  DomainOptions options;
  const std::int64_t bytes = static_cast<std::int64_t>(
      PackNewSegment(Segment(0))->payload.data.size());
  options.quotas.max_payload_bytes_per_rig = 5 * bytes / 2;
  Reopen(options);
  const Rig rig = CreateDeviceRig("a");
  for (int k = 0; k < 4; ++k) {
    PutOnDevice(rig, k);
    ScoreOnDevice(rig, k, 10.0 + k);
  }
  ReportAll(ReportedData::kAll);
  int kept = 0;
  for (int k = 0; k < 4; ++k) kept += HasData("a", k) ? 1 : 0;
  EXPECT_EQ(kept, 2);
  ExpectSame("a");
}

// Whatever happens on the device, and whatever is lost on the way to the hub.
TEST_P(ReportsTest, HubHasWhatTheDeviceHasAfterAnything) {
  Promise promise("the hub has what the device has, whatever happens");
  for (unsigned seed = 1; seed <= static_cast<unsigned>(Trials(6)); ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937 random(seed);
    const auto draw = [&](int n) {
      return std::uniform_int_distribution<int>(0, n - 1)(random);
    };
    const std::string id = "rig" + std::to_string(seed);
    Rig rig = CreateDeviceRig(id);
    std::int64_t next = 0;
    std::int64_t scored = 0;
    for (int step = 0; step < 120; ++step) {
      switch (draw(12)) {
        case 0:
        case 1:
        case 2:
        case 3:
          PutOnDevice(rig, next++);
          break;
        case 4:
        case 5:
        case 6: {
          if (scored == next) break;
          // It may be deleted or in quarantine.
          device_domain_
              ->CommitScore(id,
                            {"s", scored},
                            FakeInformation(rig,
                                            draw(50) - 25,
                                            draw(3) > 0 ? 5 : 0,
                                            static_cast<unsigned>(scored)))
              .IgnoreError();
          ++scored;
          break;
        }
        case 7: {
          device_domain_->CreateManualRun(id, true).IgnoreError();
          const auto unfinished = device_->ListUnfinishedRuns();
          for (const StoredRun& run : *unfinished) {
            if (run.rig != id || !device_domain_->BeginRun(id, run.run).ok()) {
              continue;
            }
            const int end = draw(4);
            if (end == 0) {
              ASSERT_TRUE(
                  device_domain_->EndRun(id, run.run, RunState::kFailed, "why")
                      .ok());
            } else if (end == 1) {
              StoredCalibration candidate =
                  TestCalibration(rig, *device_->GetRun(id, run.run));
              candidate.state = CalibrationState::kCandidate;
              ASSERT_TRUE(
                  device_domain_->StoreCandidate(id, run.run, candidate).ok());
            } else {
              StoredCalibration result =
                  TestCalibration(rig, *device_->GetRun(id, run.run));
              if (end == 3) {
                result.state = CalibrationState::kRejected;
                result.reasons = {"a trial"};
              }
              const auto finished =
                  device_domain_->FinishRun(id, run.run, result);
              ASSERT_TRUE(finished.ok()) << finished.status();
            }
          }
          break;
        }
        case 8:
          device_domain_->ActivateCalibration(id, 1 + draw(4), "eve", "a trial")
              .status()
              .IgnoreError();
          break;
        case 9:
          device_domain_->QuarantineSegments(id, "s", draw(20), "eve", "x")
              .IgnoreError();
          break;
        case 10:
          device_domain_->DeleteSegment(id, {"s", draw(20)}, "eve", "x")
              .IgnoreError();
          break;
        default:
          break;
      }
      if (draw(3) == 0) {
        ReportOnce(ReportedData::kNone, 1 << (4 + draw(14)), [&] {
          return draw(3) == 0;
        });
      }
      if (draw(60) == 0) {
        EXPECT_TRUE(device_->outbox()->Close().ok());
      }
      if (HasFailure()) return;
    }
    ReportAll(ReportedData::kNone, 1 << 12);
    ExpectSame(id);
    ++promise.trials;
    if (HasFailure()) {
      ++promise.lost;
      return;
    }
  }
}

}  // namespace
}  // namespace selfcal::server
