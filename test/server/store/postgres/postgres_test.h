// For tests of what only PostgreSQL promises: each has a database of its own.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "server/store/driver/statement.h"
#include "server/store/postgres/postgres_connection.h"
#include "test/server/store/postgres/postgres_engine.h"

namespace selfcal::server {

class PostgresTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const std::string why_not = PostgresCluster::WhyNot();
    if (!why_not.empty()) GTEST_SKIP() << why_not;
    static int number = 0;
    name_ = "own_" + std::to_string(++number);
    SharedPostgres().Create(name_);
    uri_ = SharedPostgres().Uri(name_);
    auto connection = PostgresConnection::Open(uri_);
    ASSERT_TRUE(connection.ok()) << connection.status();
    db_ = *std::move(connection);
  }
  void TearDown() override {
    db_.reset();
    if (!name_.empty()) SharedPostgres().Drop(name_);
  }

  std::int64_t Number(const std::string& sql) {
    const auto number = ReadInt(db_.get(), sql);
    EXPECT_TRUE(number.ok()) << number.status();
    return number.value_or(-1);
  }

  std::string name_;
  std::string uri_;
  std::unique_ptr<PostgresConnection> db_;  // beside that which is tested
};

}  // namespace selfcal::server
