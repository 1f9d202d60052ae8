// The files of which a bag consists.
#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>
#include <vector>

#include "client/recording/message_file.h"

namespace selfcal::client {

// True for a folder with metadata.yaml, as rosbag2 writes it, or with a file
// .mcap or .db3.
bool IsBagFolder(const std::string& path);

// Opens the files of the bag at `path`: the file itself or, in a folder, those
// that metadata.yaml lists; without it the only file .mcap or .db3. Files that
// cannot be opened are left out, with a sentence. The error of the first one if
// none can be opened, INVALID_ARGUMENT for metadata that cannot be parsed or
// several bags, UNIMPLEMENTED for messages that are compressed one by one.
absl::StatusOr<std::vector<std::unique_ptr<MessageFile>>> OpenBagFiles(
    const std::string& path, std::vector<std::string>* problems);

}  // namespace selfcal::client
