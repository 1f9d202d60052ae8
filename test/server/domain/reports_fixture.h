// A device and its hub, for tests of the reports between them.
#pragma once

#include <gmock/gmock.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "selfcal/store/report.pb.h"
#include "server/store/outbox.h"
#include "test/server/store/sqlite/open_sqlite_store.h"
#include "test/server/store/store_test.h"
#include "test/server/test_records.h"

namespace selfcal::server {

inline constexpr std::int64_t kLarge = std::int64_t{1} << 30;

// The store of StoreTest is that of the hub, `device_` that of the device.
class ReportsFixture : public StoreTest {
 protected:
  ReportsFixture() { OpenDevice(); }

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

}  // namespace selfcal::server
