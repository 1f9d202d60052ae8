// What every engine of the store must pass: tests take the fixture StoreTest
// and name SELFCAL_STORE_TEST_SUITE once in their file. Another engine adds
// itself to Engines(), if it is installed.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "migrations/migrations.h"
#include "server/domain/clock.h"
#include "server/domain/domain.h"
#include "server/store/make_store.h"
#include "server/store/sqlite/sqlite.h"
#include "server/store/store.h"
#include "test/server/store/fake_information.h"
#include "test/server/store/postgres/postgres_cluster.h"
#include "test/server/store/postgres/postgres_engine.h"
#include "test/server/store/sqlite/tamper.h"
#include "test/server/test_segments.h"
#include "test/support/temp_folder.h"

namespace selfcal::server {

struct Engine {
  std::string name;
  int schema_version = 0;  // the newest
  bool limits_size = false;
  // The database that this folder stands for, empty the first time; of at most
  // this many bytes, unless 0, if the engine limits the size.
  std::function<absl::StatusOr<std::unique_ptr<Database>>(
      const TempFolder&, std::int64_t max_bytes)>
      open_database;
  // Damages all blobs of a column, behind the back of a store that is closed.
  std::function<absl::Status(
      const TempFolder&, const std::string& table, const std::string& column)>
      damage;

  absl::StatusOr<std::unique_ptr<Store>> open(const TempFolder& folder,
                                              std::int64_t max_bytes) const {
    auto database = open_database(folder, max_bytes);
    if (!database.ok()) return database.status();
    return MakeStore(*std::move(database));
  }
};

inline std::vector<Engine> Engines() {
  std::vector<Engine> engines = {
      {"Sqlite",
       static_cast<int>(SqliteMigrations().size()),
       true,
       [](const TempFolder& folder, std::int64_t max_bytes) {
         return OpenSqlite({.path = folder.File("selfcal.db"),
                            .max_bytes = max_bytes,
                            .time_ns = NowNs()});
       },
       [](const TempFolder& folder,
          const std::string& table,
          const std::string& column) {
         return DamageColumn(folder.File("selfcal.db"), table, column);
       }}};
  if (PostgresCluster::WhyNot().empty()) {
    engines.push_back(
        {.name = "Postgres",
         .schema_version = static_cast<int>(PostgresMigrations().size()),
         .limits_size = false,
         .open_database =
             [](const TempFolder& folder, std::int64_t) {
               return OpenPostgresDatabase(folder);
             },
         .damage = DamagePostgresColumn});
  }
  return engines;
}

class StoreTest : public ::testing::TestWithParam<Engine> {
 protected:
  StoreTest() { Reopen(); }

  // As a restart of the daemon does.
  void Reopen(const DomainOptions& options = {}) {
    domain_.reset();
    store_.reset();
    auto opened = GetParam().open(folder_, options.quotas.max_database_bytes);
    ASSERT_TRUE(opened.ok()) << opened.status();
    store_ = *std::move(opened);
    domain_.emplace(store_.get(), options, [this] {
      return now_ns_ > 0 ? now_ns_ : NowNs();
    });
  }

  Rig CreateTestRig(const std::string& id) {
    const Rig rig = TestRig(id);
    EXPECT_TRUE(domain_->CreateRig(rig).ok());
    return rig;
  }

  // A valid segment of little data with its own key.
  static MotionSegment Segment(std::int64_t index,
                               const std::string& session = "s") {
    static const std::vector<MotionSegment> kSegments =
        TestSegments(TestRig("any"), 1);
    MotionSegment segment = kSegments.front();
    segment.key = {session, index};
    return segment;
  }

  void Put(const std::string& rig, std::int64_t index) {
    const auto verdict = domain_->PutSegment(rig, Segment(index));
    ASSERT_TRUE(verdict.ok()) << verdict.status();
    ASSERT_EQ(*verdict, PutVerdict::kStored);
  }

  ScoreCommit Score(const Rig& rig,
                    std::int64_t index,
                    double entropy,
                    double gain = 5) {
    const auto commit = domain_->CommitScore(
        rig.id,
        {"s", index},
        FakeInformation(rig, entropy, gain, static_cast<unsigned>(index)));
    EXPECT_TRUE(commit.ok()) << commit.status();
    return commit.value_or(ScoreCommit());
  }

  // The reserve for held-out tests is of the newest that no table holds: what
  // came before these is of it no more.
  void RenewReserve(const Rig& rig, std::int64_t first_index = 1000) {
    for (int k = 0; k < kReserve; ++k) {
      Put(rig.id, first_index + k);
      Score(rig, first_index + k, 99, 0.0);
    }
  }

  bool HasData(const std::string& rig, std::int64_t index) {
    const auto segment = store_->GetSegment(rig, {"s", index});
    EXPECT_TRUE(segment.ok()) << segment.status();
    const auto data = store_->GetSegmentData(rig, {"s", index});
    EXPECT_EQ(segment->has_data, data.ok());
    EXPECT_EQ(segment->has_data, segment->payload_bytes > 0);
    return data.ok();
  }

  std::vector<std::int64_t> TableIndices(const std::string& rig, int table) {
    std::vector<std::int64_t> indices;
    const auto tables = store_->GetTables(rig);
    EXPECT_TRUE(tables.ok()) << tables.status();
    for (const TableEntry& entry : (*tables)[table].entries) {
      indices.push_back(entry.key.index);
    }
    return indices;
  }

  TempFolder folder_;
  std::unique_ptr<Store> store_;
  std::optional<Domain> domain_;
  std::int64_t now_ns_ = 0;  // the time for the domain; 0: the clock's
};

#define SELFCAL_STORE_TEST_SUITE(fixture)                                      \
  INSTANTIATE_TEST_SUITE_P(                                                    \
      Engines, fixture, ::testing::ValuesIn(Engines()), [](const auto& info) { \
        return info.param.name;                                                \
      })

// Two theta of the same shape, equal to the bit.
inline void ExpectSameCalibration(const Calibration& a, const Calibration& b) {
  ASSERT_TRUE(SameShape(a, b));
  EXPECT_EQ(a.imu.s_g, b.imu.s_g);
  EXPECT_EQ(a.imu.m_g, b.imu.m_g);
  EXPECT_EQ(a.imu.s_a, b.imu.s_a);
  EXPECT_EQ(a.imu.m_a, b.imu.m_a);
  EXPECT_EQ(a.imu.q_AI.coeffs(), b.imu.q_AI.coeffs());
  for (std::size_t k = 0; k < a.cameras.size(); ++k) {
    EXPECT_EQ(a.cameras[k].q_CI.coeffs(), b.cameras[k].q_CI.coeffs());
    EXPECT_EQ(a.cameras[k].p_CI, b.cameras[k].p_CI);
    EXPECT_EQ(a.cameras[k].f, b.cameras[k].f);
    EXPECT_EQ(a.cameras[k].c, b.cameras[k].c);
    EXPECT_EQ(a.cameras[k].distortion, b.cameras[k].distortion);
    EXPECT_EQ(a.cameras[k].time_offset_s, b.cameras[k].time_offset_s);
    EXPECT_EQ(a.cameras[k].width_px, b.cameras[k].width_px);
  }
}

}  // namespace selfcal::server
