// Recordings as messages of ROS, in one bag or the files into which one is
// split. Times are the stamps in the headers of the messages.
#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "client/recording/recording.h"

namespace selfcal::client {

// Opens the bag in a folder, or a file of messages.
absl::StatusOr<std::unique_ptr<Recording>> OpenBag(
    const std::string& path, const RecordingOptions& options);

}  // namespace selfcal::client
