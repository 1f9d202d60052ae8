// Bags of ROS 2 in SQLite (rosbag2_storage_sqlite3): tables `topics` and
// `messages`, messages in CDR.
#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "client/recording/message_file.h"

namespace selfcal::client {

// Opens the file, which it never writes to. DATA_LOSS with the path for one
// that is no database.
absl::StatusOr<std::unique_ptr<MessageFile>> OpenSqliteBag(
    const std::string& path);

}  // namespace selfcal::client
