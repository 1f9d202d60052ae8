// Databases of every schema that was released: each opens with all that it
// held, and a migration that is killed at any instant changes nothing or is
// done.
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "migrations/migrations.h"
#include "test/promise.h"
#include "test/server/store/fixture_content.h"
#include "test/server/store/sqlite/fault_vfs.h"
#include "test/server/store/sqlite/sqlite_test.h"
#include "test/support/files.h"

namespace selfcal::server {
namespace {

class FixturesTest : public SqliteTest {
 protected:
  static int Newest() { return static_cast<int>(SqliteMigrations().size()); }

  static std::string Fixture(int version) {
    return std::string(SELFCAL_STORE_FIXTURES) + "/schema_v" +
           std::to_string(version) + ".sql";
  }
  // Schema versions from 1 that have a fixture: those that were released.
  static int Released() {
    int version = 0;
    while (std::filesystem::exists(Fixture(version + 1))) ++version;
    EXPECT_GE(version, 2);
    return version;
  }

  // The database of a schema version, in place of what was there.
  void Load(int version) {
    store_.reset();
    for (const auto& entry :
         std::filesystem::directory_iterator(folder_.path())) {
      std::filesystem::remove_all(entry);
    }
    const std::string made = made_.File(std::to_string(version));
    if (!std::filesystem::exists(made)) {
      const std::string sql = ReadBytes(Fixture(version));
      ASSERT_FALSE(sql.empty()) << "no fixture of schema version " << version;
      const absl::Status loaded =
          ExecuteInFile(made, sql + "PRAGMA journal_mode = WAL");
      ASSERT_TRUE(loaded.ok()) << loaded;
    }
    std::filesystem::copy_file(made, Path());
  }

  // Paths and exclusions, which segments from before schema version 7 have not.
  void ExpectMotion(bool kept) {
    const auto listed = store_->ListSessionSegments("a", "s", {});
    ASSERT_TRUE(listed.ok()) << listed.status();
    ASSERT_EQ(listed->items.size(), 4u);
    for (const SessionSegment& segment : listed->items) {
      EXPECT_EQ(segment.path.size(), kept ? 8u : 0u);
    }
    const auto exclusions = store_->ListExclusions("a", {"s", 0});
    ASSERT_TRUE(exclusions.ok()) << exclusions.status();
    EXPECT_EQ(exclusions->size(), kept ? FixtureRig().groups.size() : 0u);
  }

  // Parameters of both versions, which databases from before schema version 16
  // get later.
  void ExpectEstimates(bool kept) {
    const auto rows = [&] {
      const auto listed = store_->ListEstimates({}, {1000, ""});
      EXPECT_TRUE(listed.ok()) << listed.status();
      return listed.ok() ? listed->items.size() : 0;
    };
    const auto all =
        static_cast<std::size_t>(2 * TangentSize(FixtureRig().factory));
    EXPECT_EQ(rows(), kept ? all : 0u);
    const auto written = domain_->CompleteEstimates(100);
    ASSERT_TRUE(written.ok()) << written.status();
    EXPECT_EQ(*written, kept ? 0 : 2);
    EXPECT_EQ(rows(), all);
  }

  // Segments from before schema version 24 are in no list by their motion.
  void ExpectSegmentsWithMotion(std::size_t expected) {
    SegmentQuery query;
    query.order = SegmentQuery::Order::kAngularRate;
    const auto listed = store_->ListSegments("", query, Page{});
    ASSERT_TRUE(listed.ok()) << listed.status();
    EXPECT_EQ(listed->items.size(), expected);
    for (const StoredSegment& segment : listed->items) {
      EXPECT_TRUE(segment.motion.has_value());
    }
  }

  // Verdicts and temperatures by which lists find versions, which databases
  // from before schema version 25 get later.
  void ExpectListColumns(bool kept) {
    const auto written = domain_->CompleteVersions(100);
    ASSERT_TRUE(written.ok()) << written.status();
    EXPECT_EQ(*written, kept ? 0 : 2);
    CalibrationQuery query;
    query.verdict = VerdictKind::kFactory;
    const auto listed = store_->ListCalibrations("", query, {});
    ASSERT_TRUE(listed.ok()) << listed.status();
    ASSERT_EQ(listed->items.size(), 1u);
    EXPECT_EQ(listed->items.front().version, 1);
    query.verdict = store_->GetCalibration("a", 2)->verdict.kind;
    EXPECT_EQ(store_->ListCalibrations("", query, {})->items.size(), 1u);
  }

  static std::int64_t Version(const std::string& path) {
    return ReadIntInFile(path, "PRAGMA user_version").value_or(-1);
  }

  // Opens in a process of its own that is killed before operation n on the
  // disk. False: it was done before that.
  bool OpenAndKillAt(int n) {
    const pid_t child = fork();
    if (child == 0) {
      FaultVfs vfs;
      vfs.SetFault([n](int number, DiskOperation::Kind) {
        if (number == n) raise(SIGKILL);
        return SQLITE_OK;
      });
      _exit(Open().ok() ? 0 : 1);
    }
    int status = 0;
    EXPECT_EQ(waitpid(child, &status, 0), child);
    EXPECT_TRUE(WIFSIGNALED(status) || WEXITSTATUS(status) == 0);
    return WIFSIGNALED(status);
  }

 private:
  // A database for each schema version, to be copied.
  const TempFolder made_;
};

TEST_F(FixturesTest, EverySchemaThatWasReleasedOpensWithAllItHeld) {
  Promise promise("any past schema opens");
  for (int version = 1; version <= Released(); ++version) {
    SCOPED_TRACE("schema version " + std::to_string(version));
    Load(version);
    ++promise.trials;
    const absl::Status opened = Open();
    EXPECT_TRUE(opened.ok()) << opened;
    if (!opened.ok()) {
      ++promise.lost;
      continue;
    }
    ExpectFixture(store_.get());
    ExpectMotion(version >= 7);
    ExpectEstimates(version >= 16);
    ExpectListColumns(version >= 25);
    // And works on.
    MotionSegment segment = FixtureSegments()[0];
    segment.key = {"later", 0};
    EXPECT_TRUE(domain_->PutSegment("a", segment).ok());
    ExpectSegmentsWithMotion(version >= 24 ? 5 : 1);
    EXPECT_TRUE(domain_
                    ->CommitScore(
                        "a", {"s", 3}, FakeInformation(FixtureRig(), 0.5, 5, 9))
                    .ok());
    store_.reset();
    EXPECT_EQ(IntegrityOf(Path()), "ok");
    EXPECT_EQ(Version(Path()), Newest());
    if (version < Newest()) {
      EXPECT_EQ(Version(Path() + ".backup-v" + std::to_string(version)),
                version);
    }
  }
}

TEST_F(FixturesTest, AMigrationThatIsKilledChangesNothingOrIsDone) {
  Promise promise("a killed migration changes nothing");
  for (int version = 1; version <= Released(); ++version) {
    if (version == Newest()) break;
    Load(version);
    int operations = 0;
    {
      FaultVfs vfs;
      vfs.SetFault(nullptr);
      ASSERT_TRUE(Open().ok());
      operations = vfs.operations();
      store_.reset();
    }
    const int step = std::max(1, operations / Trials(25));
    for (int n = 1; n <= operations; n += step) {
      SCOPED_TRACE("schema version " + std::to_string(version) +
                   ", killed before operation " + std::to_string(n));
      Load(version);
      if (!OpenAndKillAt(n)) break;
      ++promise.trials;
      const absl::Status opened = Open();
      EXPECT_TRUE(opened.ok()) << opened;
      if (!opened.ok()) {
        ++promise.lost;
        return;
      }
      ExpectFixture(store_.get());
      store_.reset();
      EXPECT_EQ(IntegrityOf(Path()), "ok");
      EXPECT_EQ(Version(Path()), Newest());
      if (HasFailure()) return;
    }
  }
}

}  // namespace
}  // namespace selfcal::server
