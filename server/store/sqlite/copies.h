// Copies of an SQLite file, made over a read-only connection of its own.
#pragma once

#include <memory>
#include <string>

#include "server/store/driver/database_copies.h"

namespace selfcal::server {

// `path` is that of a database that this process has open.
std::unique_ptr<DatabaseCopies> MakeSqliteCopies(std::string path);

}  // namespace selfcal::server
