// Maintenance of an SQLite file, over read-only connections of its own.
#pragma once

#include <memory>
#include <string>

#include "server/store/maintenance.h"

namespace selfcal::server {

// `path` is that of a database that this process has open.
std::unique_ptr<StoreMaintenance> MakeSqliteMaintenance(std::string path);

}  // namespace selfcal::server
