// The care of an SQLite file, on connections of its own that only read.
#pragma once

#include <memory>
#include <string>

#include "server/store/maintenance.h"

namespace selfcal::server {

// `path` is that of a database which this process has open.
std::unique_ptr<StoreMaintenance> MakeSqliteMaintenance(std::string path);

}  // namespace selfcal::server
