// Statements and transactions (server/store/driver) on SQLite.
#include "server/store/driver/statement.h"

#include <gtest/gtest.h>

#include "server/store/driver/transaction.h"
#include "server/store/sqlite/sqlite_connection.h"
#include "test/support/temp_folder.h"

namespace selfcal::server {
namespace {

class StatementTest : public ::testing::Test {
 protected:
  StatementTest()
      : owned_(*SqliteConnection::Open(
            folder_.File("x.db"), SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE)),
        db_(*owned_) {
    EXPECT_TRUE(
        db_.Execute("CREATE TABLE t (i INTEGER, r REAL, s TEXT, b BLOB) STRICT")
            .ok());
  }

  std::int64_t Count() {
    Statement read(&db_, "SELECT count(*) FROM t");
    EXPECT_TRUE(read.Next());
    return read.Int(0);
  }

  TempFolder folder_;
  const std::unique_ptr<SqliteConnection> owned_;
  SqliteConnection& db_;
};

TEST_F(StatementTest, ValuesComeBackAsTheyWereBound) {
  const std::string bytes("\0\xff\x01", 3);
  const double third = 1.0 / 3;
  ASSERT_TRUE(Statement(&db_,
                        "INSERT INTO t VALUES (?1, ?2, ?3, ?4)",
                        INT64_MIN,
                        third,
                        std::string("it's; DROP TABLE t"),
                        BlobView{bytes})
                  .Run()
                  .ok());
  Statement read(&db_, "SELECT i, r, s, b, NULL FROM t");
  ASSERT_TRUE(read.Next());
  EXPECT_EQ(read.Int(0), INT64_MIN);
  EXPECT_EQ(read.Double(1), third);
  EXPECT_EQ(read.Text(2), "it's; DROP TABLE t");
  EXPECT_EQ(read.Text(3), bytes);
  EXPECT_TRUE(read.IsNull(4));
  EXPECT_FALSE(read.Next());
  EXPECT_TRUE(read.status().ok());
}

TEST_F(StatementTest, FirstErrorStays) {
  Statement bad(&db_, "SELECT * FROM missing WHERE x = ?1", 5);
  EXPECT_FALSE(bad.Next());
  EXPECT_FALSE(bad.Next());
  EXPECT_EQ(bad.status().code(), absl::StatusCode::kInternal);
}

TEST_F(StatementTest, OneThatIsPreparedAgainKnowsNothingOfBefore) {
  const char* const insert = "INSERT INTO t (i, s) VALUES (?1, ?2)";
  ASSERT_TRUE(Statement(&db_, insert, 1, std::string("one")).Run().ok());
  ASSERT_TRUE(Statement(&db_, insert, 2).Run().ok());
  ASSERT_TRUE(Statement(&db_, insert, 3).Run().ok());
  const char* const select = "SELECT s FROM t WHERE i >= ?1 ORDER BY i";
  {
    Statement first(&db_, select, 1);
    ASSERT_TRUE(first.Next());
    Statement second(&db_, select, 2);  // while the first is in use
    ASSERT_TRUE(second.Next());
    EXPECT_EQ(first.Text(0), "one");
    EXPECT_TRUE(second.IsNull(0));
  }
  Statement third(&db_, select, 3);  // from the start, not where one stood
  ASSERT_TRUE(third.Next());
  EXPECT_TRUE(third.IsNull(0));
  EXPECT_FALSE(third.Next());
  EXPECT_TRUE(third.status().ok());
}

TEST_F(StatementTest, AnErrorDoesNotStayWithThePreparedStatement) {
  ASSERT_TRUE(db_.Execute("CREATE UNIQUE INDEX once ON t (i)").ok());
  const char* const insert = "INSERT INTO t (i) VALUES (?1)";
  ASSERT_TRUE(Statement(&db_, insert, 1).Run().ok());
  EXPECT_FALSE(Statement(&db_, insert, 1).Run().ok());
  EXPECT_TRUE(Statement(&db_, insert, 2).Run().ok());
  ASSERT_TRUE(db_.Execute("ALTER TABLE t ADD COLUMN more INTEGER").ok());
  EXPECT_TRUE(Statement(&db_, insert, 3).Run().ok());
  EXPECT_EQ(Count(), 3);
}

TEST_F(StatementTest, TransactionRollsBackUnlessCommitted) {
  {
    Transaction transaction(&db_);
    ASSERT_TRUE(transaction.status().ok());
    ASSERT_TRUE(db_.Execute("INSERT INTO t (i) VALUES (1)").ok());
  }
  EXPECT_EQ(Count(), 0);
  Transaction transaction(&db_);
  ASSERT_TRUE(db_.Execute("INSERT INTO t (i) VALUES (1)").ok());
  ASSERT_TRUE(transaction.Commit().ok());
  EXPECT_EQ(Count(), 1);
}

TEST_F(StatementTest, FullDiskIsResourceExhaustedAndChangesNothing) {
  ASSERT_TRUE(db_.Execute("PRAGMA max_page_count = 5").ok());
  const std::string large(50'000, 'x');
  {
    Transaction transaction(&db_);
    const absl::Status status =
        Statement(&db_, "INSERT INTO t (b) VALUES (?1)", BlobView{large}).Run();
    EXPECT_TRUE(absl::IsResourceExhausted(status)) << status;
  }
  EXPECT_EQ(Count(), 0);
  ASSERT_TRUE(db_.Execute("PRAGMA max_page_count = 1000").ok());
  Transaction transaction(&db_);
  EXPECT_TRUE(Statement(&db_, "INSERT INTO t (b) VALUES (?1)", BlobView{large})
                  .Run()
                  .ok());
  EXPECT_TRUE(transaction.Commit().ok());
  EXPECT_EQ(Count(), 1);
}

TEST_F(StatementTest, ErrorsOfTheEnvironmentHaveTheirCodes) {
  EXPECT_TRUE(absl::IsUnavailable(db_.StatusOf(SQLITE_IOERR_FSYNC, "x")));
  EXPECT_TRUE(absl::IsUnavailable(db_.StatusOf(SQLITE_BUSY, "x")));
  EXPECT_TRUE(absl::IsUnavailable(db_.StatusOf(SQLITE_READONLY, "x")));
  EXPECT_TRUE(absl::IsResourceExhausted(db_.StatusOf(SQLITE_NOMEM, "x")));
  EXPECT_TRUE(absl::IsDataLoss(db_.StatusOf(SQLITE_CORRUPT_INDEX, "x")));
  EXPECT_TRUE(absl::IsDataLoss(db_.StatusOf(SQLITE_NOTADB, "x")));
  EXPECT_TRUE(db_.StatusOf(SQLITE_ROW, "x").ok());
}

}  // namespace
}  // namespace selfcal::server
