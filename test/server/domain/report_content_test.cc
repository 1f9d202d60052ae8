// Reports whose content no device would have sent: the hub refuses them, and is
// as before.
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "server/store/checksum.h"
#include "server/store/payload.h"
#include "server/store/records.h"
#include "test/server/domain/reports_fixture.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;

class ReportContentTest : public ReportsFixture {
 protected:
  Report FirstReport() {
    ReportNewRigs(ReportedData::kAll);
    return *device_->outbox()->Next(device_->outbox()->List()->front(), kLarge);
  }

  static store::ReportedRecords RecordsOf(const Report& report) {
    store::ReportedRecords records;
    EXPECT_TRUE(records.ParseFromString(report.records));
    return records;
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
};
SELFCAL_STORE_TEST_SUITE(ReportContentTest);

TEST_P(ReportContentTest, WhatIsNoReportIsRefusedAndChangesNothing) {
  const Rig rig = CreateDeviceRig("a");
  PutOnDevice(rig, 0);
  ScoreOnDevice(rig, 0, 1.0);
  const Report report = FirstReport();
  const store::ReportedRecords good = RecordsOf(report);
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
  // Two bytes each, a hundred in memory.
  bad.emplace_back(good);
  for (int i = 0; i < 5'000'000; ++i) bad.back().mutable_records(0)->add_rows();
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
TEST_P(ReportContentTest, RecordsThatDoNotFitTheRigAreRefusedAndChangeNothing) {
  const Rig rig = CreateDeviceRig("a");
  const MotionSegment segment = Segment(0);
  PutOnDevice(rig, 0);
  ScoreOnDevice(rig, 0, 1.0);
  const Report report = FirstReport();
  const store::ReportedRecords good = RecordsOf(report);

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
TEST_P(ReportContentTest, WhatIsDamagedOfASegmentHoldsUpNothing) {
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

}  // namespace
}  // namespace selfcal::server
