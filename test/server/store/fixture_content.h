// What the databases under fixtures/ hold, written once and looked for in every
// schema since.
#pragma once

#include <gtest/gtest.h>

#include "server/domain/domain.h"
#include "test/server/store/fake_information.h"
#include "test/server/test_segments.h"

namespace selfcal::server {

inline Rig FixtureRig() {
  Rig rig = TestRig("a");
  return rig;
}

// Four segments: three scored, of which the tables keep two, and one that
// waits.
inline std::vector<MotionSegment> FixtureSegments() {
  return TestSegments(FixtureRig(), 4);
}

// False if the store refuses any of it.
inline bool WriteFixture(Store* store) {
  Domain domain(store);
  const Rig rig = FixtureRig();
  if (!domain.CreateRig(rig).ok()) return false;
  for (const MotionSegment& segment : FixtureSegments()) {
    if (!domain.PutSegment("a", segment).ok()) return false;
    if (segment.key.index == 3) break;
    const auto seed = static_cast<unsigned>(segment.key.index);
    if (!domain
             .CommitScore(
                 "a", segment.key, FakeInformation(rig, 3.0 - seed, 5, seed))
             .ok()) {
      return false;
    }
  }
  // The tables became full with the second segment.
  const auto run = domain.BeginRun("a", 1);
  if (!run.ok()) return false;
  const auto size = TangentSize(rig.factory);
  StoredCalibration calibration;
  calibration.rig = "a";
  calibration.theta = rig.factory;
  calibration.theta.cameras[0].f.x() += 1;
  calibration.covariance = 4 * Eigen::MatrixXd::Identity(size, size);
  calibration.run = 1;
  calibration.base_version = 1;
  calibration.segments = run->segments;
  calibration.program_version = "fixture";
  calibration.report = CalibrationResult();
  calibration.report->theta = calibration.theta;
  calibration.report->covariance = calibration.covariance;
  return domain.FinishRun("a", 1, calibration).ok();
}

inline void ExpectFixture(Store* store) {
  const auto rig = store->GetRig("a");
  ASSERT_TRUE(rig.ok()) << rig.status();
  EXPECT_EQ(rig->rig.table_size, FixtureRig().table_size);
  const auto found = store->ListRigSummaries({.text = "a"}, {});
  ASSERT_TRUE(found.ok()) << found.status();
  EXPECT_EQ(found->items.size(), 1u);
  const auto segments = store->ListSegments("a", {});
  ASSERT_TRUE(segments.ok()) << segments.status();
  ASSERT_EQ(segments->items.size(), 4u);
  for (const StoredSegment& segment : segments->items) {
    EXPECT_EQ(segment.information.has_value(), segment.key.index < 3);
    EXPECT_EQ(
        segment.state,
        segment.key.index < 3 ? SegmentState::kScored : SegmentState::kStored);
    EXPECT_EQ(segment.sequence, segment.key.index + 1);
    EXPECT_TRUE(segment.problem.empty()) << segment.problem;
    if (!segment.has_data) continue;
    const auto data = store->GetSegmentData("a", segment.key);
    ASSERT_TRUE(data.ok()) << data.status();
    EXPECT_EQ(data->observations.size(),
              FixtureSegments()[segment.key.index].observations.size());
  }
  const auto unscored = store->ListUnscored(10);
  ASSERT_TRUE(unscored.ok()) << unscored.status();
  ASSERT_EQ(unscored->size(), 1u);
  EXPECT_EQ(unscored->front().key.index, 3);
  EXPECT_TRUE(store->GetSegmentData("a", {"s", 3}).ok());
  const auto tables = store->GetTables("a");
  ASSERT_TRUE(tables.ok()) << tables.status();
  for (const Table& table : *tables) {
    ASSERT_EQ(table.entries.size(), 2u);
    EXPECT_EQ(table.entries[0].key.index, 2);
    EXPECT_EQ(table.entries[1].key.index, 1);
  }
  const auto active = store->GetActiveCalibration("a");
  ASSERT_TRUE(active.ok()) << active.status();
  EXPECT_EQ(active->version, 2);
  EXPECT_EQ(active->state, CalibrationState::kActive);
  EXPECT_EQ(active->theta.cameras[0].f.x(),
            FixtureRig().factory.cameras[0].f.x() + 1);
  EXPECT_EQ(active->program_version, "fixture");
  EXPECT_EQ(active->segments.size(), 2u);
  const auto factory = store->GetCalibration("a", 1);
  ASSERT_TRUE(factory.ok()) << factory.status();
  EXPECT_EQ(factory->state, CalibrationState::kSuperseded);
  EXPECT_EQ(factory->theta.cameras[0].f, FixtureRig().factory.cameras[0].f);
  const auto runs = store->ListRuns("a", {});
  ASSERT_TRUE(runs.ok()) << runs.status();
  ASSERT_FALSE(runs->items.empty());
  EXPECT_EQ(runs->items.back().state, RunState::kSucceeded);
  const auto events = store->ListEvents({});
  ASSERT_TRUE(events.ok()) << events.status();
  ASSERT_GE(events->items.size(), 4u);
  EXPECT_EQ(events->items.front().kind, EventKind::kRigCreated);
}

}  // namespace selfcal::server
