// Writes and reads of many threads: their order, conflicts, and connections
// that are lost.
#include "server/store/postgres/postgres_database.h"

#include <signal.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <future>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include "server/store/driver/transaction.h"
#include "test/server/store/postgres/postgres_test.h"
#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;

Database::Work Insert(int x, const absl::Status& then = {}) {
  return [x, then](Connection* db) -> absl::Status {
    Transaction transaction(db);
    if (!transaction.status().ok()) return transaction.status();
    const absl::Status inserted =
        Statement(db, "INSERT INTO t VALUES (?1)", x).Run();
    if (!inserted.ok()) return inserted;
    if (!then.ok()) return then;
    return transaction.Commit();
  };
}

std::vector<int> Stored(Database* database) {
  std::vector<int> stored;
  const absl::Status status = database->Read([&](Connection* db) {
    stored.clear();
    Statement read(db, "SELECT x FROM t ORDER BY arrival");
    while (read.Next()) stored.push_back(static_cast<int>(read.Int(0)));
    return read.status();
  });
  EXPECT_TRUE(status.ok()) << status;
  return stored;
}

class PostgresDatabaseTest : public PostgresTest {
 protected:
  void SetUp() override {
    PostgresTest::SetUp();
    if (IsSkipped()) return;
    ASSERT_TRUE(db_->Execute("CREATE TABLE t (x BIGINT, arrival BIGINT "
                             "GENERATED ALWAYS AS IDENTITY)")
                    .ok());
    database_ = std::make_unique<PostgresDatabase>(uri_, 3, 3);
  }
  void TearDown() override {
    database_.reset();
    PostgresTest::TearDown();
  }

  // Ends all connections to the database but that of the test.
  void TerminateOthers() {
    Number(
        "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity "
        "WHERE datname = current_database() AND pid <> pg_backend_pid()");
    EXPECT_TRUE(Eventually([this] {
      return Number(
                 "SELECT count(*) FROM pg_stat_activity "
                 "WHERE datname = current_database()") == 1;
    }));
  }

  std::unique_ptr<PostgresDatabase> database_;
};

// While a daemon is stopped, others wait for the lock on a rig that it writes.
TEST_F(PostgresDatabaseTest, AWriteThatStopsGivesUpItsLocksAfterTenSeconds) {
  const auto limit_ms = [](std::int64_t* limit) {
    return [limit](Connection* db) -> absl::Status {
      const auto read =
          ReadInt(db,
                  "SELECT setting::bigint FROM pg_settings "
                  "WHERE name = 'idle_in_transaction_session_timeout'");
      *limit = read.value_or(0);
      return read.status();
    };
  };
  std::int64_t of_writes = 0;
  std::int64_t of_reads = 0;
  ASSERT_TRUE(database_->Write(limit_ms(&of_writes)).ok());
  ASSERT_TRUE(database_->Read(limit_ms(&of_reads)).ok());
  EXPECT_EQ(of_writes, 10'000);
  EXPECT_EQ(of_reads, 60'000);  // a caller may read slowly
}

TEST_F(PostgresDatabaseTest, AWriteDoesNotWaitForALockForEver) {
  ASSERT_TRUE(db_->Execute("BEGIN").ok());
  ASSERT_TRUE(db_->Execute("LOCK TABLE t").ok());
  const absl::Status refused = database_->Write(Insert(1));
  EXPECT_EQ(refused.code(), absl::StatusCode::kUnavailable) << refused;
  ASSERT_TRUE(db_->Execute("ROLLBACK").ok());
  ASSERT_TRUE(database_->Write(Insert(2)).ok());
  EXPECT_EQ(Stored(database_.get()), std::vector<int>{2});
}

TEST_F(PostgresDatabaseTest, WritesOfOneThreadAreCarriedOutInTheirOrder) {
  std::vector<int> expected;
  std::vector<int> answered;
  for (int k = 0; k < 50; ++k) {
    expected.push_back(k);
    database_->BeginWrite(Insert(k), [&, k](const absl::Status& status) {
      EXPECT_TRUE(status.ok()) << status;
      answered.push_back(k);
    });
  }
  expected.push_back(50);
  ASSERT_TRUE(database_->Write(Insert(50)).ok());
  EXPECT_EQ(answered.size(), 50u);
  EXPECT_TRUE(std::is_sorted(answered.begin(), answered.end()));
  EXPECT_EQ(Stored(database_.get()), expected);
}

TEST_F(PostgresDatabaseTest, ManyThreadsLoseNothing) {
  std::vector<std::thread> threads;
  for (int t = 0; t < 8; ++t) {
    threads.emplace_back([this, t] {
      for (int k = 0; k < 25; ++k) {
        EXPECT_TRUE(database_->Write(Insert(t * 1000 + k)).ok());
        EXPECT_FALSE(Stored(database_.get()).empty());
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  const std::vector<int> stored = Stored(database_.get());
  EXPECT_EQ(stored.size(), 200u);
  std::vector<int> last(8, -1);
  for (const int x : stored) {  // of each thread, in its order
    EXPECT_LT(last[x / 1000], x % 1000);
    last[x / 1000] = x % 1000;
  }
}

TEST_F(PostgresDatabaseTest, OneThatFailsOrThrowsLeavesNothing) {
  EXPECT_TRUE(absl::IsNotFound(
      database_->Write(Insert(1, absl::NotFoundError("bad")))));
  EXPECT_TRUE(
      absl::IsInternal(database_->Write([](Connection* db) -> absl::Status {
        Transaction transaction(db);
        EXPECT_TRUE(Statement(db, "INSERT INTO t VALUES (2)").Run().ok());
        throw std::runtime_error("a defect");
      })));
  ASSERT_TRUE(database_->Write(Insert(3)).ok());
  EXPECT_EQ(Stored(database_.get()), (std::vector<int>{3}));
  EXPECT_EQ(database_->retries(), 0);
}

TEST_F(PostgresDatabaseTest, QueuedWritesAreCarriedOutBeforeTheEnd) {
  std::atomic<int> answered = 0;
  for (int k = 0; k < 100; ++k) {
    database_->BeginWrite(Insert(k), [&](const absl::Status& status) {
      answered += status.ok() ? 1 : 0;
    });
  }
  database_.reset();
  EXPECT_EQ(answered, 100);
  EXPECT_EQ(Number("SELECT count(*) FROM t"), 100);
}

// Two transactions lock the same two rows in opposite orders: the server ends
// one of them (40P01), which is carried out again.
TEST_F(PostgresDatabaseTest, ADeadlockIsResolvedByCarryingOneOutAgain) {
  ASSERT_TRUE(db_->Execute("INSERT INTO t VALUES (1), (2)").ok());
  std::atomic<int> holding = 0;
  std::atomic<int> attempts = 0;
  const auto work = [&](int first, int second) {
    return [&, first, second](Connection* db) -> absl::Status {
      Transaction transaction(db);
      const char* const sql = "UPDATE t SET x = x + 10 WHERE arrival = ?1";
      absl::Status status = Statement(db, sql, first).Run();
      if (!status.ok()) return status;
      ++attempts;
      ++holding;
      EXPECT_TRUE(Eventually([&] { return holding >= 2; }));
      status = Statement(db, sql, second).Run();
      if (!status.ok()) return status;
      return transaction.Commit();
    };
  };
  PostgresDatabase other_database(uri_, 1, 1);
  std::thread other(
      [&] { EXPECT_TRUE(other_database.Write(work(2, 1)).ok()); });
  EXPECT_TRUE(database_->Write(work(1, 2)).ok());
  other.join();
  // The two may meet like this once more before one has both rows.
  const auto retries = database_->retries() + other_database.retries();
  EXPECT_GE(retries, 1);
  EXPECT_EQ(attempts, 2 + retries);
  EXPECT_EQ(Number("SELECT sum(x)::bigint FROM t"), 1 + 2 + 4 * 10);
}

// Two serializable transactions each read what the other changes: one fails
// (40001), here at its commit, and is carried out again.
TEST_F(PostgresDatabaseTest, ASerializationFailureIsCarriedOutAgain) {
  ASSERT_TRUE(db_->Execute("INSERT INTO t VALUES (1)").ok());
  std::atomic<int> read = 0;
  std::atomic<int> attempts = 0;
  const auto add_total = [&](Connection* db) -> absl::Status {
    ++attempts;
    Transaction transaction(db);
    absl::Status status =
        db->Execute("SET TRANSACTION ISOLATION LEVEL SERIALIZABLE");
    if (!status.ok()) return status;
    const auto total = ReadInt(db, "SELECT sum(x)::bigint FROM t");
    if (!total.ok()) return total.status();
    ++read;
    EXPECT_TRUE(Eventually([&] { return read >= 2; }));
    status = Statement(db, "INSERT INTO t VALUES (?1)", *total).Run();
    if (!status.ok()) return status;
    return transaction.Commit();
  };
  PostgresDatabase other_database(uri_, 1, 1);
  std::thread other([&] { EXPECT_TRUE(other_database.Write(add_total).ok()); });
  EXPECT_TRUE(database_->Write(add_total).ok());
  other.join();
  // The two may meet like this once more before one has both rows.
  const auto retries = database_->retries() + other_database.retries();
  EXPECT_GE(retries, 1);
  EXPECT_EQ(attempts, 2 + retries);
  // Each as if it had been alone: 1, 1 + 1 = 2 and then the sum of those.
  EXPECT_EQ(Number("SELECT sum(x)::bigint FROM t"), 4);
}

TEST_F(PostgresDatabaseTest, AConflictThatDoesNotEndIsAnswered) {
  int attempts = 0;
  const absl::Status status =
      database_->Write([&](Connection* db) -> absl::Status {
        ++attempts;
        Transaction transaction(db);
        return db->Execute(
            "DO $$ BEGIN RAISE EXCEPTION 'x' USING ERRCODE = '40001'; END $$");
      });
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("try again"));
  EXPECT_EQ(attempts, 10);
}

TEST_F(PostgresDatabaseTest, LostIdleConnectionsAreReplacedWithoutAnError) {
  ASSERT_TRUE(database_->Write(Insert(1)).ok());
  EXPECT_EQ(Stored(database_.get()).size(), 1u);
  TerminateOthers();
  EXPECT_TRUE(database_->Write(Insert(2)).ok());
  TerminateOthers();
  EXPECT_EQ(Stored(database_.get()).size(), 2u);
}

TEST_F(PostgresDatabaseTest, AWriteThatLosesItsConnectionIsCarriedOutOnce) {
  bool first = true;
  const absl::Status status =
      database_->Write([&](Connection* db) -> absl::Status {
        Transaction transaction(db);
        const absl::Status inserted =
            Statement(db, "INSERT INTO t VALUES (1)").Run();
        if (!inserted.ok()) return inserted;
        if (std::exchange(first, false)) TerminateOthers();
        return Statement(db, "SELECT 1").Run().ok()
                   ? transaction.Commit()
                   : absl::UnavailableError("lost");
      });
  EXPECT_TRUE(status.ok()) << status;
  EXPECT_EQ(Stored(database_.get()), (std::vector<int>{1}));
}

TEST_F(PostgresDatabaseTest, ReadsOfTheServiceDoNotWaitForThoseOfCallers) {
  std::vector<std::future<absl::Status>> slow;
  for (int k = 0; k < 3; ++k) {  // all readers of the fixture
    slow.push_back(std::async(std::launch::async, [this] {
      return database_->Read(
          [](Connection* db) { return db->Execute("SELECT pg_sleep(60)"); });
    }));
  }
  const auto count = [&](const std::string& what) {
    return Number("SELECT count(" + what +
                  ") FROM pg_stat_activity WHERE datname = current_database() "
                  "AND query = 'SELECT pg_sleep(60)'");
  };
  ASSERT_TRUE(Eventually([&] { return count("*") == 3; }));
  EXPECT_TRUE(database_
                  ->ReadForService(
                      [](Connection* db) { return db->Execute("SELECT 1"); })
                  .ok());
  EXPECT_EQ(count("*"), 3);
  EXPECT_EQ(count("pg_cancel_backend(pid)"), 3);
  for (auto& read : slow) {
    const absl::Status status = read.get();
    EXPECT_TRUE(absl::IsUnavailable(status)) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr("took too long"));
  }
}

TEST_F(PostgresDatabaseTest, OnlyAReadForACallerHasALimit) {
  std::string limit;
  const Database::Work show = [&](Connection* db) {
    Statement read(db, "SHOW statement_timeout");
    if (read.Next()) limit = read.Text(0);
    return read.status();
  };
  EXPECT_TRUE(database_->Read(show).ok());
  EXPECT_EQ(limit, "30s");
  EXPECT_TRUE(database_->ReadForService(show).ok());
  EXPECT_EQ(limit, "0");
}

// The server ends the connection while it commits, and does not commit.
TEST_F(PostgresDatabaseTest, ACommitThatIsLostIsNotASuccess) {
  ASSERT_TRUE(
      db_->Execute(
             "CREATE FUNCTION die() RETURNS trigger LANGUAGE plpgsql AS $$ "
             "BEGIN PERFORM pg_terminate_backend(pg_backend_pid()); "
             "  PERFORM pg_sleep(60); RETURN NULL; END $$;"
             "CREATE CONSTRAINT TRIGGER die AFTER INSERT ON t "
             "DEFERRABLE INITIALLY DEFERRED FOR EACH ROW "
             "WHEN (NEW.x = 13) EXECUTE FUNCTION die()")
          .ok());
  const absl::Status status = database_->Write(Insert(13));
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("may or may not"));
  EXPECT_EQ(database_->retries(), 0);
  ASSERT_TRUE(database_->Write(Insert(14)).ok());
  EXPECT_EQ(Stored(database_.get()), (std::vector<int>{14}));
}

// With a server of its own, which the test stops or changes.
class PostgresServerTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const std::string why_not = PostgresCluster::WhyNot();
    if (!why_not.empty()) GTEST_SKIP() << why_not;
    cluster_ = std::make_unique<PostgresCluster>();
    cluster_->Create("own");
    Reconnect();
    ASSERT_TRUE(db_->Execute("CREATE TABLE t (x BIGINT, arrival BIGINT "
                             "GENERATED ALWAYS AS IDENTITY)")
                    .ok());
    database_ = std::make_unique<PostgresDatabase>(cluster_->Uri("own"), 1, 1);
  }

  void Reconnect() {
    auto connection = PostgresConnection::Open(cluster_->Uri("own"));
    ASSERT_TRUE(connection.ok()) << connection.status();
    db_ = *std::move(connection);
  }

  // Commits a write on a server that waits for a standby that is not there, and
  // calls this function of the server for the process that waits.
  absl::Status WriteAndInterrupt(const std::string& function) {
    EXPECT_TRUE(
        db_->Execute("ALTER SYSTEM SET synchronous_standby_names = 'x'").ok());
    EXPECT_TRUE(db_->Execute("SELECT pg_reload_conf()").ok());
    // The server takes the setting up a moment later: commits that leave no row
    // show when it has.
    EXPECT_TRUE(Eventually([&] {
      auto probe = std::async(std::launch::async, [this] {
        return database_->Write([](Connection* db) {
          return db->Execute("SELECT pg_logical_emit_message(true, '', '')");
        });
      });
      return InterruptCommit("pg_cancel_backend", &probe);
    }));
    auto written = std::async(std::launch::async,
                              [this] { return database_->Write(Insert(1)); });
    EXPECT_TRUE(InterruptCommit(function, &written));
    return written.get();
  }

  // False if the write has ended without waiting for a standby.
  bool InterruptCommit(const std::string& function,
                       std::future<absl::Status>* written) {
    const std::string waiting =
        " FROM pg_stat_activity WHERE wait_event = 'SyncRep'";
    bool found = false;
    EXPECT_TRUE(Eventually([&] {
      found = ReadInt(db_.get(), "SELECT count(*)" + waiting).value_or(0) == 1;
      return found || written->wait_for(std::chrono::seconds(0)) ==
                          std::future_status::ready;
    }));
    if (!found) return false;
    EXPECT_TRUE(db_->Execute("SELECT " + function + "(pid)" + waiting).ok());
    written->wait();
    return true;
  }

  std::unique_ptr<PostgresCluster> cluster_;
  std::unique_ptr<PostgresConnection> db_;
  std::unique_ptr<PostgresDatabase> database_;  // ends before its server
};

TEST_F(PostgresServerTest, ACommitThatWasLostAfterItHappenedIsNotASuccess) {
  const absl::Status status = WriteAndInterrupt("pg_terminate_backend");
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("may or may not"));
  EXPECT_EQ(database_->retries(), 0);
  EXPECT_EQ(Stored(database_.get()), (std::vector<int>{1}));
}

TEST_F(PostgresServerTest, ACommitThatNoStandbyHasIsNotASuccess) {
  const absl::Status status = WriteAndInterrupt("pg_cancel_backend");
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("standby"));
  EXPECT_EQ(database_->retries(), 0);
}

TEST_F(PostgresServerTest, AServerThatIsStoppedIsUnavailableUntilItStarts) {
  ASSERT_TRUE(database_->Write(Insert(1)).ok());
  for (const int signal : {SIGINT, SIGQUIT}) {
    cluster_->Stop(signal);
    const absl::Status status = database_->Write(Insert(2));
    EXPECT_TRUE(absl::IsUnavailable(status)) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr("check the server"));
    EXPECT_TRUE(absl::IsUnavailable(
        database_->Read([](Connection*) { return absl::OkStatus(); })));
    cluster_->Start();
    EXPECT_TRUE(Eventually([this] {
      return database_->Read([](Connection*) { return absl::OkStatus(); }).ok();
    }));
    EXPECT_EQ(Stored(database_.get()), (std::vector<int>{1}));
  }
}

TEST_F(PostgresServerTest, TooManyConnectionsAreARefusal) {
  ASSERT_TRUE(db_->Execute("CREATE ROLE few LOGIN CONNECTION LIMIT 1").ok());
  std::string uri = cluster_->Uri("own");
  uri.replace(uri.find("postgres@"), 9, "few@");
  const auto first = PostgresConnection::Open(uri);
  ASSERT_TRUE(first.ok()) << first.status();
  const auto second = PostgresConnection::Open(uri);
  EXPECT_TRUE(absl::IsResourceExhausted(second.status())) << second.status();
}

TEST_F(PostgresServerTest, AServerThatOnlyLetsReadIsUnavailable) {
  ASSERT_TRUE(database_->Write(Insert(1)).ok());
  ASSERT_TRUE(
      db_->Execute("ALTER SYSTEM SET default_transaction_read_only = on").ok());
  ASSERT_TRUE(db_->Execute("SELECT pg_reload_conf()").ok());
  EXPECT_TRUE(Eventually([this] {
    return absl::IsUnavailable(
        PostgresConnection::Open(cluster_->Uri("own")).status());
  }));
}

}  // namespace
}  // namespace selfcal::server
