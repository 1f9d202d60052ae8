#include "server/store/postgres/postgres_listener.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "server/store/driver/transaction.h"
#include "server/store/postgres/postgres_database.h"
#include "test/server/store/postgres/postgres_test.h"
#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

using Texts = std::vector<std::string>;

// Keeps what a listener hears.
class Ear {
 public:
  Listener::Heard Hear() {
    return [this](const std::optional<std::string>& text) {
      const std::lock_guard lock(mutex_);
      heard_.push_back(text.value_or("missed"));
    };
  }
  Texts heard() const {
    const std::lock_guard lock(mutex_);
    return heard_;
  }
  bool Hears(const std::string& text) const {
    return Eventually([&] { return Count(text) > 0; });
  }
  std::ptrdiff_t Count(const std::string& text) const {
    const Texts all = heard();
    return std::count(all.begin(), all.end(), text);
  }

 private:
  mutable std::mutex mutex_;
  Texts heard_;
};

Database::Work Announce(const std::string& text,
                        const absl::Status& then = {}) {
  return [text, then](Connection* db) -> absl::Status {
    Transaction transaction(db);
    if (!transaction.status().ok()) return transaction.status();
    const absl::Status announced = db->Announce(text);
    if (!announced.ok()) return announced;
    if (!then.ok()) return then;
    return transaction.Commit();
  };
}

class PostgresListenerTest : public PostgresTest {
 protected:
  void SetUp() override {
    PostgresTest::SetUp();
    if (IsSkipped()) return;
    database_ = std::make_unique<PostgresDatabase>(uri_, 1, 1);
    other_ = std::make_unique<PostgresDatabase>(uri_, 1, 1);
  }
  void TearDown() override {
    database_.reset();
    other_.reset();
    PostgresTest::TearDown();
  }

  std::unique_ptr<PostgresDatabase> database_;
  std::unique_ptr<PostgresDatabase> other_;
};

TEST_F(PostgresListenerTest, WhatIsCommittedIsAnnouncedToOthersAlone) {
  Ear own_ear, others_ear;
  const auto own = database_->Listen(own_ear.Hear());
  const auto others = other_->Listen(others_ear.Hear());
  ASSERT_TRUE(own_ear.Hears("missed"));
  ASSERT_TRUE(others_ear.Hears("missed"));
  ASSERT_FALSE(
      database_->Write(Announce("never", absl::InternalError("fails"))).ok());
  ASSERT_TRUE(database_->Write(Announce("run a 1")).ok());
  ASSERT_TRUE(database_->Write(Announce("run a 2")).ok());
  ASSERT_TRUE(others_ear.Hears("run a 2"));
  EXPECT_EQ(others_ear.heard(), (Texts{"missed", "run a 1", "run a 2"}));
  ASSERT_TRUE(other_->Write(Announce("run b 1")).ok());
  ASSERT_TRUE(own_ear.Hears("run b 1"));
  EXPECT_EQ(own_ear.heard(), (Texts{"missed", "run b 1"}));
}

TEST_F(PostgresListenerTest, OneThatWasCutOffSaysSoAndGoesOn) {
  Ear ear;
  const auto listener = database_->Listen(ear.Hear());
  ASSERT_TRUE(ear.Hears("missed"));
  Number(
      "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity "
      "WHERE datname = current_database() AND pid <> pg_backend_pid()");
  ASSERT_TRUE(Eventually([&] { return ear.Count("missed") == 2; }));
  ASSERT_TRUE(other_->Write(Announce("run a 1")).ok());
  EXPECT_TRUE(ear.Hears("run a 1"));
}

TEST_F(PostgresListenerTest, NowAndThenItSupposesThatItHasMissedSome) {
  Ear ear;
  const PostgresListener listener(
      uri_, "own", ear.Hear(), std::chrono::milliseconds(20));
  EXPECT_TRUE(Eventually([&] { return ear.Count("missed") > 3; }));
  ASSERT_TRUE(other_->Write(Announce("run a 1")).ok());
  EXPECT_TRUE(ear.Hears("run a 1"));
}

}  // namespace
}  // namespace selfcal::server
