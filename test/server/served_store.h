// What an API serves in tests: a real SQLite store with its domain, a pipeline
// that computes nothing, and the feed of events.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "server/api/event_feed.h"
#include "server/domain/domain.h"
#include "server/store/store.h"
#include "test/server/fake_pipeline.h"
#include "test/server/store/sqlite/open_sqlite_store.h"
#include "test/server/test_records.h"
#include "test/server/test_segments.h"
#include "test/support/temp_folder.h"

namespace selfcal::server {

class ServedStore : public ::testing::Test {
 protected:
  ServedStore() { OpenDomain({}); }

  void OpenDomain(const DomainOptions& options) {
    domain_.emplace(store_.get(), options);
    pipeline_ = std::make_unique<FakePipeline>(&*domain_);
  }

  // Creates rigs/{id} in the store.
  Rig AddRig(const std::string& id = "r") {
    const Rig rig = TestRig(id);
    const auto created = domain_->CreateRig(rig);
    EXPECT_TRUE(created.ok()) << created.status();
    return rig;
  }

  const TempFolder temp_folder_;
  const std::filesystem::path folder_ = temp_folder_.path();
  std::unique_ptr<Store> store_ = NewStore(folder_);
  std::optional<Domain> domain_;
  std::unique_ptr<FakePipeline> pipeline_;
  EventFeed feed_{store_.get(), nullptr};

 private:
  static std::unique_ptr<Store> NewStore(const std::filesystem::path& folder) {
    auto store = OpenSqliteStore(folder / "test.db");
    if (!store.ok()) throw std::runtime_error(store.status().ToString());
    return *std::move(store);
  }
};

}  // namespace selfcal::server
