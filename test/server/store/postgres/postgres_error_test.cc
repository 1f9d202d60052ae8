#include "server/store/postgres/postgres_error.h"

#include <gmock/gmock.h>

#include <string>

#include "server/store/postgres/store_uri.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

absl::StatusCode CodeOf(std::string_view sqlstate) {
  return PostgresError(sqlstate, "x", "y").code();
}

// https://www.postgresql.org/docs/15/errcodes-appendix.html
TEST(PostgresError, ErrorsOfTheEnvironmentHaveTheirCodes) {
  EXPECT_EQ(CodeOf("53100"), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(CodeOf("53200"), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(CodeOf("53300"), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(CodeOf("53400"), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(CodeOf("08006"), absl::StatusCode::kUnavailable);
  EXPECT_EQ(CodeOf("57P01"), absl::StatusCode::kUnavailable);
  EXPECT_EQ(CodeOf("57P03"), absl::StatusCode::kUnavailable);
  EXPECT_EQ(CodeOf("58030"), absl::StatusCode::kUnavailable);
  EXPECT_EQ(CodeOf("25006"), absl::StatusCode::kUnavailable);
  EXPECT_EQ(CodeOf("40001"), absl::StatusCode::kUnavailable);
  EXPECT_EQ(CodeOf("XX001"), absl::StatusCode::kDataLoss);
  EXPECT_EQ(CodeOf("XX002"), absl::StatusCode::kDataLoss);
  EXPECT_EQ(CodeOf("XX000"), absl::StatusCode::kInternal);
  EXPECT_EQ(CodeOf("23505"), absl::StatusCode::kInternal);
  EXPECT_EQ(CodeOf("P0001"), absl::StatusCode::kInternal);
}

TEST(PostgresError, TooManyConnectionsAreARefusal) {
  EXPECT_TRUE(absl::IsResourceExhausted(
      ConnectionError("FATAL:  sorry, too many clients already\n")));
  EXPECT_TRUE(absl::IsResourceExhausted(ConnectionError(
      "FATAL:  remaining connection slots are reserved for superusers\n")));
  const absl::Status refused =
      ConnectionError("Connection refused\n\tIs the server running?\n");
  EXPECT_TRUE(absl::IsUnavailable(refused));
  EXPECT_THAT(std::string(refused.message()),
              HasSubstr("refused Is the server running?;"));
}

TEST(ShownUri, HasNeitherPasswordNorParameters) {
  EXPECT_EQ(ShownUri("postgresql://hub:se%40cret@db1:5433,db2:5434/fleet"
                     "?sslmode=require&password=other&application_name=x")
                .value(),
            "postgresql://hub@db1:5433,db2:5434/fleet");
  EXPECT_EQ(ShownUri("postgres://db/fleet?user=hub&password=secret").value(),
            "postgresql://hub@db/fleet");
  EXPECT_EQ(ShownUri("postgresql:///fleet?host=%2Frun%2Fpostgresql").value(),
            "postgresql:///run/postgresql/fleet");
}

TEST(ShownUri, AnInvalidAddressIsNotQuoted) {
  for (const char* uri : {"postgresql://hub:secret@[::1/fleet",
                          "postgresql://hub:secret@db/fleet?nonsense=1",
                          "postgresql://hub:secret%zz@db/fleet",
                          "mysql://hub:secret@db/fleet",
                          "hub:secret@db"}) {
    const auto shown = ShownUri(uri);
    EXPECT_TRUE(absl::IsInvalidArgument(shown.status())) << uri;
    EXPECT_THAT(shown.status().ToString(), Not(HasSubstr("secret")));
  }
}

}  // namespace
}  // namespace selfcal::server
