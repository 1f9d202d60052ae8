// Reports of a device to its hub: the hub has what the device has, whatever is
// lost on the way; a rig that is reported belongs to its device.
#include <cmath>
#include <map>
#include <random>
#include <vector>

#include "selfcal/store/report.pb.h"
#include "server/store/change_rows.h"
#include "server/store/checksum.h"
#include "server/store/outbox.h"
#include "server/store/records.h"
#include "test/promise.h"
#include "test/server/domain/reports_fixture.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class ReportsTest : public ReportsFixture {};
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

TEST_P(ReportsTest, MotionAtTheHubIsThatOfTheDevice) {
  const Rig rig = CreateDeviceRig("a");
  PutOnDevice(rig, 0);
  ReportAll();
  const auto device = device_->GetSegment("a", {"s", 0});
  ASSERT_TRUE(device.ok()) << device.status();
  ASSERT_TRUE(device->motion.has_value());
  const auto hub = store_->GetSegment("a", {"s", 0});
  ASSERT_TRUE(hub.ok()) << hub.status();
  EXPECT_EQ(hub->motion, device->motion);
}

// Its tables end before the columns with the motion.
TEST_P(ReportsTest, DeviceThatDoesNotKnowMotionIsTaken) {
  const Rig rig = CreateDeviceRig("a");
  PutOnDevice(rig, 0);
  ReportNewRigs(ReportedData::kNone);
  Report report = NextReport();
  store::ReportedRecords records;
  ASSERT_TRUE(records.ParseFromString(report.records));
  int index = 0;
  int removed = 0;
  for (auto& table : *records.mutable_tables()) {
    const int of = index++;
    if (table.name() != "segments") continue;
    ASSERT_EQ(table.columns(table.columns_size() - 2), "angular_rate");
    ASSERT_EQ(table.columns(table.columns_size() - 1), "acceleration");
    for (int k = 0; k < 2; ++k) table.mutable_columns()->RemoveLast();
    for (auto& record : *records.mutable_records()) {
      for (auto& row : *record.mutable_rows()) {
        if (row.table() != of) continue;
        for (int k = 0; k < 2; ++k) row.mutable_values()->RemoveLast();
        ++removed;
      }
    }
  }
  ASSERT_EQ(removed, 1);
  report.records = records.SerializeAsString();
  const auto answer = Give(report);
  ASSERT_TRUE(answer.ok()) << answer.status();
  const auto hub = store_->GetSegment("a", {"s", 0});
  ASSERT_TRUE(hub.ok()) << hub.status();
  EXPECT_EQ(hub->motion, std::nullopt);
  EXPECT_EQ(hub->keyframes, device_->GetSegment("a", {"s", 0})->keyframes);
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

// With its checksum: both read the same prior.
TEST_P(ReportsTest, AChangedPriorMeanIsReported) {
  const Rig rig = CreateDeviceRig("a");
  ReportAll();
  Calibration mean = rig.factory;
  mean.cameras[0].f.x() += 1;
  const auto updated = device_domain_->UpdateRig(
      "a",
      [&](StoredRig stored) -> absl::StatusOr<StoredRig> {
        stored.rig.prior_mean = mean;
        return stored;
      },
      "eve");
  ASSERT_TRUE(updated.ok()) << updated.status();
  ReportAll();
  ASSERT_TRUE(store_->GetRig("a")->rig.prior_mean.has_value());
  ExpectSameCalibration(*store_->GetRig("a")->rig.prior_mean, mean);
  ExpectSame("a");
}

// A hub fuses information with the prior of the rig.
TEST_P(ReportsTest, APriorMeanOfAnotherShapeIsRefused) {
  Rig rig = TestRig("a");
  rig.prior_mean = rig.factory;
  rig.prior_mean->cameras.push_back(rig.factory.cameras[0]);
  ASSERT_TRUE(device_domain_->CreateRig(rig).ok());
  ReportNewRigs(ReportedData::kNone);
  const auto answer = Give(NextReport());
  EXPECT_TRUE(absl::IsInvalidArgument(answer.status())) << answer.status();
  EXPECT_THAT(std::string(answer.status().message()), HasSubstr("prior_mean"));
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

TEST_P(ReportsTest, ReportedRigsAreCountedByTheirLastReports) {
  constexpr std::int64_t kTime = 1'700'000'000'000'000'000;
  const auto none = store_->CountReported(kTime);
  ASSERT_TRUE(none.ok()) << none.status();
  EXPECT_EQ(none->rigs, 0);
  EXPECT_EQ(none->waiting, 0);
  EXPECT_EQ(none->newest_ns, 0);
  CreateTestRig("of_the_hub");
  CreateDeviceRig("a");
  CreateDeviceRig("b");
  ReportNewRigs(ReportedData::kNone);
  const auto rigs = device_->outbox()->List();
  ASSERT_THAT(*rigs, SizeIs(2));
  for (const ReportedRig& rig : *rigs) {
    auto report = device_->outbox()->Next(rig, kLarge);
    ASSERT_TRUE(report.ok()) << report.status();
    now_ns_ = rig.rig == "a" ? kTime : kTime + 10;
    report->waiting = rig.rig == "a" ? 2 : 7;
    ASSERT_TRUE(Give(*report).ok());
  }
  const auto both = store_->CountReported(kTime + 1);
  ASSERT_TRUE(both.ok()) << both.status();
  EXPECT_EQ(both->rigs, 2);
  EXPECT_EQ(both->silent, 1);
  EXPECT_EQ(both->waiting, 9);
  EXPECT_EQ(both->oldest_ns, kTime);
  EXPECT_EQ(both->newest_ns, kTime + 10);
  EXPECT_EQ(store_->CountReported(kTime)->silent, 0);
  ASSERT_TRUE(domain_->DeleteRig("a", "eve", "trial").ok());
  EXPECT_EQ(store_->CountReported(kTime + 1)->rigs, 1);
  EXPECT_EQ(store_->CountReported(kTime + 1)->silent, 0);
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

// Lists of the hub find the versions of a device by the verdicts that these
// have: after each of the records that change one.
TEST_P(ReportsTest, HubFindsVersionsByTheVerdictsOfTheDevice) {
  const Rig rig = CreateDeviceRig("a");
  MotionSegment segment = Segment(0);
  segment.temperature_c = 21.5;
  ASSERT_TRUE(device_domain_->PutSegment("a", segment).ok());
  ScoreOnDevice(rig, 0, 1.0);
  using Lists = std::map<VerdictKind, std::vector<std::int64_t>>;
  const auto lists = [](Store* store) {
    Lists found;
    CalibrationQuery query;
    for (const VerdictKind kind : {VerdictKind::kUnknown,
                                   VerdictKind::kGood,
                                   VerdictKind::kWeak,
                                   VerdictKind::kNotTrustworthy,
                                   VerdictKind::kFactory}) {
      query.verdict = kind;
      const auto listed = store->ListCalibrations("", query, {});
      EXPECT_TRUE(listed.ok()) << listed.status();
      for (const StoredCalibration& version : listed->items) {
        found[kind].push_back(version.version);
      }
    }
    return found;
  };
  const auto expect = [&](const Lists& expected) {
    EXPECT_EQ(lists(device_.get()), expected);
    ReportAll();
    EXPECT_EQ(lists(store_.get()), expected);
  };
  const auto finish = [&](std::int64_t run, CalibrationState state) {
    StoredCalibration result = TestCalibration(rig, *device_->GetRun("a", run));
    result.state = state;
    result.verdict.kind = VerdictKind::kGood;
    ASSERT_TRUE(device_domain_->FinishRun("a", run, result).ok());
  };
  StoreCandidateOnDevice(rig);
  expect({{VerdictKind::kFactory, {1}}, {VerdictKind::kUnknown, {2}}});
  finish(1, CalibrationState::kActive);
  expect({{VerdictKind::kFactory, {1}}, {VerdictKind::kGood, {2}}});
  ASSERT_TRUE(device_domain_->CreateManualRun("a", true).ok());
  ASSERT_TRUE(device_domain_->BeginRun("a", 2).ok());
  finish(2, CalibrationState::kRejected);
  expect({{VerdictKind::kFactory, {1}},
          {VerdictKind::kGood, {2}},
          {VerdictKind::kNotTrustworthy, {3}}});
  StoredChange change;
  change.rig = "a";
  change.change = 1;
  change.time_ns = 5;
  change.base_version = 1;
  change.first_sequence = 1;
  ASSERT_TRUE(
      device_
          ->Transact(
              "a", 1, [&](UnitOfWork* tx) { return InsertChange(tx, change); })
          .ok());
  expect(
      {{VerdictKind::kFactory, {1}}, {VerdictKind::kNotTrustworthy, {3, 2}}});
  ASSERT_TRUE(device_domain_->ActivateCalibration("a", 1, "eve", "x").ok());
  expect({{VerdictKind::kFactory, {1}},
          {VerdictKind::kGood, {2}},
          {VerdictKind::kNotTrustworthy, {3}}});
  ASSERT_TRUE(device_domain_->ReportDisagreement("a", 2, "by 3 sigma").ok());
  expect(
      {{VerdictKind::kFactory, {1}}, {VerdictKind::kNotTrustworthy, {3, 2}}});

  CalibrationQuery warm;
  warm.order = CalibrationQuery::Order::kTemperature;
  warm.temperature_c = {21.5, 21.5};
  const auto of_hub = store_->ListCalibrations("", warm, {});
  ASSERT_TRUE(of_hub.ok()) << of_hub.status();
  EXPECT_THAT(of_hub->items, SizeIs(2));
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
                                 NowNs() + days * 24 * 3600 * 1'000'000'000,
                                 kEndOfReportsKept_ns)
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
        domain_->ReplaceScore("a", {1, {}}, scored, score, {}),
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
