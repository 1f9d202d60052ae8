// Changes that come at the same time share a commit, and are told apart in it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <thread>

#include "server/store/driver/statement.h"
#include "server/store/driver/transaction.h"
#include "server/store/sqlite/open_database.h"
#include "server/store/sqlite/sqlite_database.h"
#include "test/support/eventually.h"
#include "test/support/temp_folder.h"

namespace selfcal::server {
namespace {

using ::testing::Test;

constexpr Migration kNumbers{
    "0001.sql", "aa", "CREATE TABLE t (x INTEGER) STRICT;"};

class GroupCommitTest : public Test {
 protected:
  GroupCommitTest() {
    const std::string path = folder_.File("test.db");
    auto opened = SqliteDatabase::Open(path, [path] {
      return OpenDatabase(path, std::vector<Migration>{kNumbers}, 0);
    });
    EXPECT_TRUE(opened.ok()) << opened.status();
    db_ = *std::move(opened);
  }

  static Database::Work Insert(int x, const absl::Status& then = {}) {
    return [x, then](Connection* db) -> absl::Status {
      Transaction transaction(db);
      const absl::Status inserted =
          Statement(db, "INSERT INTO t VALUES (?1)", x).Run();
      if (!inserted.ok()) return inserted;
      if (!then.ok()) return then;
      return transaction.Commit();
    };
  }

  std::vector<int> Stored() {
    std::vector<int> stored;
    const absl::Status status = db_->Read([&](Connection* db) {
      stored.clear();
      Statement read(db, "SELECT x FROM t ORDER BY rowid");
      while (read.Next()) stored.push_back(static_cast<int>(read.Int(0)));
      return read.status();
    });
    EXPECT_TRUE(status.ok()) << status;
    return stored;
  }

  // Holds the thread that writes until Release, so that what comes meanwhile
  // is one group.
  void Hold() {
    db_->BeginWrite(
        [this](Connection*) {
          held_ = true;
          EXPECT_TRUE(Eventually([this] { return released_.load(); }));
          return absl::OkStatus();
        },
        [](const absl::Status&) {});
    EXPECT_TRUE(Eventually([this] { return held_.load(); }));
  }
  void Release() { released_ = true; }

  TempFolder folder_;
  std::atomic<bool> held_ = false;
  std::atomic<bool> released_ = false;
  std::unique_ptr<SqliteDatabase> db_;  // goes first: its thread uses the rest
};

TEST_F(GroupCommitTest, WhatWaitsTogetherIsCommittedTogetherInItsOrder) {
  Hold();
  std::vector<int> answered;
  for (int k = 0; k < 10; ++k) {
    db_->BeginWrite(Insert(k), [&answered, k](const absl::Status& status) {
      EXPECT_TRUE(status.ok()) << status;
      answered.push_back(k);
    });
  }
  const std::int64_t before = db_->commits();
  Release();
  ASSERT_TRUE(db_->Write(Insert(10)).ok());
  EXPECT_EQ(answered, (std::vector<int>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9}));
  EXPECT_EQ(Stored(), (std::vector<int>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10}));
  // The one that held, the ten, and the last, which may have joined the ten.
  EXPECT_LE(db_->commits() - before, 3);
}

TEST_F(GroupCommitTest, OneThatFailsLeavesTheOthers) {
  Hold();
  std::atomic<int> failed = 0;
  for (int k = 0; k < 9; ++k) {
    const bool bad = k % 3 == 1;
    db_->BeginWrite(
        Insert(k, bad ? absl::NotFoundError("bad") : absl::OkStatus()),
        [&failed, bad](const absl::Status& status) {
          EXPECT_EQ(absl::IsNotFound(status), bad);
          failed += bad ? 1 : 0;
        });
  }
  Release();
  ASSERT_TRUE(db_->Write(Insert(9)).ok());
  EXPECT_EQ(failed, 3);
  EXPECT_EQ(Stored(), (std::vector<int>{0, 2, 3, 5, 6, 8, 9}));
}

TEST_F(GroupCommitTest, OneThatThrowsLeavesTheOthers) {
  Hold();
  db_->BeginWrite(Insert(1), [](const absl::Status& status) {
    EXPECT_TRUE(status.ok()) << status;
  });
  db_->BeginWrite(
      [](Connection* db) -> absl::Status {
        Transaction transaction(db);
        EXPECT_TRUE(Statement(db, "INSERT INTO t VALUES (2)").Run().ok());
        throw std::runtime_error("a defect");
      },
      [](const absl::Status& status) {
        EXPECT_TRUE(absl::IsInternal(status)) << status;
      });
  Release();
  ASSERT_TRUE(db_->Write(Insert(3)).ok());
  EXPECT_EQ(Stored(), (std::vector<int>{1, 3}));
}

TEST_F(GroupCommitTest, OneThatLosesTheTransactionLeavesTheOthers) {
  Hold();
  std::atomic<int> stored = 0;
  const auto count = [&](const absl::Status& status) {
    stored += status.ok() ? 1 : 0;
  };
  db_->BeginWrite(Insert(1), count);
  // As SQLite does by itself where the disk is full.
  db_->BeginWrite(
      [](Connection* db) -> absl::Status {
        EXPECT_TRUE(db->Execute("ROLLBACK").ok());
        return absl::ResourceExhaustedError("full");
      },
      [](const absl::Status& status) {
        EXPECT_TRUE(absl::IsResourceExhausted(status)) << status;
      });
  db_->BeginWrite(Insert(2), count);
  Release();
  ASSERT_TRUE(db_->Write(Insert(3)).ok());
  EXPECT_EQ(stored, 2);
  EXPECT_EQ(Stored(), (std::vector<int>{1, 2, 3}));
}

TEST_F(GroupCommitTest, WhatIsQueuedIsCarriedOutBeforeTheEnd) {
  Hold();
  std::atomic<int> answered = 0;
  for (int k = 0; k < 200; ++k) {
    db_->BeginWrite(Insert(k), [&](const absl::Status& status) {
      answered += status.ok() ? 1 : 0;
    });
  }
  std::thread end([this] { db_.reset(); });
  Release();
  end.join();
  EXPECT_EQ(answered, 200);
}

TEST_F(GroupCommitTest, ReadersDoNotWaitForTheThreadThatWrites) {
  ASSERT_TRUE(db_->Write(Insert(1)).ok());
  Hold();
  EXPECT_EQ(Stored(), (std::vector<int>{1}));
  Release();
}

// As for an hour of streams: the log is written over from its start.
TEST_F(GroupCommitTest, TheLogIsMovedIntoTheFileBySize) {
  const std::string data(1 << 20, 'x');
  ASSERT_TRUE(
      db_->Write([](Connection* db) {
           return Statement(db, "CREATE TABLE large (data BLOB) STRICT").Run();
         })
          .ok());
  for (int k = 0; k < 150; ++k) {
    const absl::Status written = db_->Write([&](Connection* db) {
      return Statement(db, "INSERT INTO large VALUES (?1)", BlobView{data})
          .Run();
    });
    ASSERT_TRUE(written.ok()) << written;
  }
  const auto size = [&](const std::string& name) {
    return std::filesystem::file_size(folder_.File(name));
  };
  EXPECT_LT(size("test.db-wal"), 50u << 20);
  EXPECT_GT(size("test.db"), 100u << 20);
}

TEST_F(GroupCommitTest, ManyThreadsLoseNothing) {
  std::vector<std::thread> threads;
  for (int t = 0; t < 8; ++t) {
    threads.emplace_back([this, t] {
      for (int k = 0; k < 50; ++k) {
        EXPECT_TRUE(db_->Write(Insert(t * 1000 + k)).ok());
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  const std::vector<int> stored = Stored();
  EXPECT_EQ(stored.size(), 400u);
  std::vector<int> last(8, -1);
  for (const int x : stored) {  // of each thread, in its order
    EXPECT_LT(last[x / 1000], x % 1000);
    last[x / 1000] = x % 1000;
  }
}

}  // namespace
}  // namespace selfcal::server
