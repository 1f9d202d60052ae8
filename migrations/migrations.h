// The numbered SQL files of each engine, as they were when the program was
// built. Migration k (from 1) takes the schema from version k - 1 to k; all of
// them together are the schema that the program works on.
#pragma once

#include <span>
#include <string_view>

namespace selfcal::server {

struct Migration {
  std::string_view name;    // "0001_initial.sql"
  std::string_view sha256;  // of the file, in lower-case hex
  std::string_view sql;
};

// In the order in which they are applied. Lives as long as the program.
std::span<const Migration> SqliteMigrations();
std::span<const Migration> PostgresMigrations();

}  // namespace selfcal::server
