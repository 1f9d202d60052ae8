// Statements and transactions (server/store/driver) on PostgreSQL.
#include "server/store/postgres/postgres_statement.h"

#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include "server/store/driver/transaction.h"
#include "test/server/store/postgres/postgres_test.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;

class PostgresStatementTest : public PostgresTest {
 protected:
  void SetUp() override {
    PostgresTest::SetUp();
    if (IsSkipped()) return;
    ASSERT_TRUE(db_->Execute("CREATE TABLE t (i BIGINT, r DOUBLE PRECISION, "
                             "s TEXT, b BYTEA, yes BOOLEAN, small INTEGER)")
                    .ok());
  }
};

TEST_F(PostgresStatementTest, ValuesComeBackAsTheyWereBound) {
  const std::string bytes("\0\xff\x01", 3);
  const double third = 1.0 / 3;
  for (const std::int64_t integer : {INT64_MIN, INT64_MAX, std::int64_t{-1}}) {
    ASSERT_TRUE(db_->Execute("DELETE FROM t").ok());
    ASSERT_TRUE(Statement(db_.get(),
                          "INSERT INTO t (i, r, s, b) VALUES (?1, ?2, ?3, ?4)",
                          integer,
                          third,
                          std::string("it's; DROP TABLE t \xc3\xa9"),
                          BlobView{bytes})
                    .Run()
                    .ok());
    Statement read(db_.get(), "SELECT i, r, s, b, NULL FROM t");
    ASSERT_TRUE(read.Next()) << read.status();
    EXPECT_EQ(read.Int(0), integer);
    EXPECT_EQ(read.Double(1), third);
    EXPECT_EQ(read.Text(2), "it's; DROP TABLE t \xc3\xa9");
    EXPECT_EQ(read.Text(3), bytes);
    EXPECT_TRUE(read.IsNull(4));
    EXPECT_FALSE(read.Next());
    EXPECT_TRUE(read.status().ok());
  }
}

TEST_F(PostgresStatementTest, InfinityIsStoredAndNanIsNull) {
  const double infinity = std::numeric_limits<double>::infinity();
  ASSERT_TRUE(Statement(db_.get(),
                        "INSERT INTO t (i, r) VALUES (1, ?1), (2, ?2), (3, ?3)",
                        infinity,
                        -infinity,
                        std::nan(""))
                  .Run()
                  .ok());
  Statement read(db_.get(), "SELECT r FROM t ORDER BY i");
  ASSERT_TRUE(read.Next());
  EXPECT_EQ(read.Double(0), infinity);
  ASSERT_TRUE(read.Next());
  EXPECT_EQ(read.Double(0), -infinity);
  ASSERT_TRUE(read.Next());
  EXPECT_TRUE(read.IsNull(0));
  EXPECT_EQ(read.Double(0), 0);
}

TEST_F(PostgresStatementTest, IntegersAreConvertedToWhatTheServerExpects) {
  ASSERT_TRUE(Statement(db_.get(),
                        "INSERT INTO t (yes, r, small) VALUES (?1, ?2, ?3)",
                        1,
                        7,
                        -5)
                  .Run()
                  .ok());
  Statement read(db_.get(),
                 "SELECT yes, r, small, NOT yes, count(*) OVER (), "
                 "  EXISTS (SELECT 1 FROM t WHERE yes = ?1) FROM t",
                 0);
  ASSERT_TRUE(read.Next()) << read.status();
  EXPECT_EQ(read.Int(0), 1);
  EXPECT_EQ(read.Double(1), 7);
  EXPECT_EQ(read.Int(1), 7);
  EXPECT_EQ(read.Int(2), -5);
  EXPECT_EQ(read.Double(2), -5);
  EXPECT_EQ(read.Int(3), 0);
  EXPECT_EQ(read.Int(4), 1);
  EXPECT_EQ(read.Int(5), 0);
  Statement large(
      db_.get(), "INSERT INTO t (small) VALUES (?1)", std::int64_t{1} << 40);
  EXPECT_THAT(std::string(large.Run().message()), HasSubstr("?1"));
}

TEST_F(PostgresStatementTest, UnboundParametersAreNullAndOneMayBeUsedTwice) {
  Statement read(db_.get(),
                 "SELECT CAST(?1 AS BIGINT) IS NULL, "
                 "  CAST(?2 AS BIGINT) + CAST(?2 AS BIGINT), '?1'",
                 std::optional<std::int64_t>(),
                 21);
  ASSERT_TRUE(read.Next()) << read.status();
  EXPECT_EQ(read.Int(0), 1);
  EXPECT_EQ(read.Int(1), 42);
  EXPECT_EQ(read.Text(2), "?1");
}

TEST_F(PostgresStatementTest, FirstErrorStays) {
  Statement bad(db_.get(), "SELECT * FROM missing WHERE x = ?1", 5);
  EXPECT_FALSE(bad.Next());
  EXPECT_FALSE(bad.Next());
  EXPECT_EQ(bad.status().code(), absl::StatusCode::kInternal);
  EXPECT_THAT(std::string(bad.status().message()), HasSubstr("42P01"));
}

TEST_F(PostgresStatementTest, OneThatIsPreparedAgainKnowsNothingOfBefore) {
  const char* const insert = "INSERT INTO t (i, s) VALUES (?1, ?2)";
  ASSERT_TRUE(Statement(db_.get(), insert, 1, std::string("one")).Run().ok());
  ASSERT_TRUE(Statement(db_.get(), insert, 2).Run().ok());
  ASSERT_TRUE(Statement(db_.get(), insert, 3).Run().ok());
  const char* const select = "SELECT s FROM t WHERE i >= ?1 ORDER BY i";
  {
    Statement first(db_.get(), select, 1);
    ASSERT_TRUE(first.Next());
    Statement second(db_.get(), select, 2);  // while the first is in use
    ASSERT_TRUE(second.Next());
    EXPECT_EQ(first.Text(0), "one");
    EXPECT_TRUE(second.IsNull(0));
    ASSERT_TRUE(first.Next());  // the rest was kept
    ASSERT_TRUE(first.Next());
    EXPECT_FALSE(first.Next());
    EXPECT_TRUE(first.status().ok());
  }
  Statement third(db_.get(), select, 3);
  ASSERT_TRUE(third.Next());
  EXPECT_TRUE(third.IsNull(0));
  EXPECT_FALSE(third.Next());
  EXPECT_TRUE(third.status().ok());
}

// Those that are not kept for another use are freed on the server, too.
TEST_F(PostgresStatementTest, StatementsDoNotPileUpOnTheServer) {
  for (int k = 0; k < 300; ++k) {
    Statement read(db_.get(), "SELECT " + std::to_string(k));
    ASSERT_TRUE(read.Next());
    EXPECT_EQ(read.Int(0), k);
  }
  EXPECT_LT(Number("SELECT count(*) FROM pg_prepared_statements"), 150);
}

TEST_F(PostgresStatementTest, RowsOfALargeTableAreNotKeptInMemory) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer keeps memory that was given back";
#endif
  ASSERT_TRUE(
      db_->Execute("INSERT INTO t (b) SELECT convert_to(repeat('x', 1000000), "
                   "'UTF8') FROM generate_series(1, 200)")
          .ok());
  const auto resident = [] {
    long pages = 0;
    FILE* const file = fopen("/proc/self/statm", "r");
    EXPECT_EQ(fscanf(file, "%*d %ld", &pages), 1);
    fclose(file);
    return pages * 4096;
  };
  const auto before = resident();
  Statement read(db_.get(), "SELECT b FROM t");
  int rows = 0;
  for (; read.Next(); ++rows) EXPECT_EQ(read.Text(0).size(), 1'000'000u);
  EXPECT_EQ(rows, 200);
  EXPECT_LT(resident() - before, 50 << 20);
}

TEST_F(PostgresStatementTest, TransactionRollsBackUnlessCommitted) {
  {
    Transaction transaction(db_.get());
    ASSERT_TRUE(transaction.status().ok());
    ASSERT_TRUE(db_->Execute("INSERT INTO t (i) VALUES (1)").ok());
  }
  EXPECT_EQ(Number("SELECT count(*) FROM t"), 0);
  Transaction transaction(db_.get());
  ASSERT_TRUE(db_->Execute("INSERT INTO t (i) VALUES (1)").ok());
  {
    Transaction part(db_.get());
    ASSERT_TRUE(part.status().ok());
    ASSERT_TRUE(db_->Execute("INSERT INTO t (i) VALUES (2)").ok());
    EXPECT_FALSE(db_->Execute("SELECT * FROM missing").ok());
  }
  ASSERT_TRUE(transaction.Commit().ok());
  EXPECT_EQ(Number("SELECT sum(i)::bigint FROM t"), 1);
}

TEST_F(PostgresStatementTest, ACommitAfterAnErrorFailsWithThatError) {
  Transaction transaction(db_.get());
  ASSERT_TRUE(db_->Execute("INSERT INTO t (i) VALUES (1)").ok());
  EXPECT_FALSE(db_->Execute("SELECT * FROM missing").ok());
  const absl::Status later = Statement(db_.get(), "SELECT 1").Run();
  EXPECT_THAT(std::string(later.message()), HasSubstr("42P01"));
  const absl::Status committed = transaction.Commit();
  EXPECT_THAT(std::string(committed.message()), HasSubstr("42P01"));
  EXPECT_EQ(Number("SELECT count(*) FROM t"), 0);
}

TEST_F(PostgresStatementTest, SnapshotsOnlyReadAndStayAsTheyWere) {
  const auto other = PostgresConnection::Open(uri_);
  ASSERT_TRUE(other.ok());
  {
    const Snapshot snapshot(db_.get());
    ASSERT_TRUE(snapshot.status().ok());
    EXPECT_EQ(Number("SELECT count(*) FROM t"), 0);
    ASSERT_TRUE((*other)->Execute("INSERT INTO t (i) VALUES (1)").ok());
    EXPECT_EQ(Number("SELECT count(*) FROM t"), 0);
    EXPECT_FALSE(db_->Execute("INSERT INTO t (i) VALUES (2)").ok());
  }
  ASSERT_TRUE(db_->lost());  // it could be a server that has become a standby
  EXPECT_EQ(ReadInt(other->get(), "SELECT count(*) FROM t").value_or(0), 1);
}

TEST_F(PostgresStatementTest, CommitsAreSynchronousWhateverTheDefaultIs) {
  ASSERT_TRUE(
      db_->Execute("ALTER DATABASE " + name_ + " SET synchronous_commit = off")
          .ok());
  const auto other = PostgresConnection::Open(uri_);
  ASSERT_TRUE(other.ok());
  Statement read(other->get(), "SHOW synchronous_commit");
  ASSERT_TRUE(read.Next());
  EXPECT_EQ(read.Text(0), "on");
}

TEST(WithDollarParameters, ChangesParametersOutsideOfQuotes) {
  EXPECT_EQ(WithDollarParameters("a = ?1 AND b = '?2 it''s ?' AND c = ?12"),
            "a = $1 AND b = '?2 it''s ?' AND c = $12");
}

}  // namespace
}  // namespace selfcal::server
