// The check of an SQLite file as far as SQLite and the migrations know it.
#pragma once

#include <functional>

#include "server/store/driver/store_problem.h"

namespace selfcal::server {

class SqliteConnection;

// Connection::CheckStructure.
void CheckSqliteStructure(
    SqliteConnection* db,
    const std::function<bool(const StoreProblem&)>& on_problem);

}  // namespace selfcal::server
