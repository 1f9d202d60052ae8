// The check of a PostgreSQL database as far as the engine and the migrations
// know it: the schema and the references. Pages and indices are checked by the
// engine's own tools (data checksums, pg_amcheck).
#pragma once

#include <functional>

#include "server/store/driver/store_problem.h"

namespace selfcal::server {

class PostgresConnection;

// Connection::CheckStructure.
void CheckPostgresStructure(
    PostgresConnection* db,
    const std::function<bool(const StoreProblem&)>& on_problem);

}  // namespace selfcal::server
