// The store on a database.
#pragma once

#include <memory>

#include "server/store/driver/driver.h"
#include "server/store/store.h"

namespace selfcal::server {

std::unique_ptr<Store> MakeStore(std::unique_ptr<Database> database);

}  // namespace selfcal::server
