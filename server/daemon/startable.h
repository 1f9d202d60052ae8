// Whether a start would succeed where the daemon would run.
#pragma once

#include <absl/status/status.h>

#include <filesystem>
#include <string>
#include <vector>

namespace selfcal::server {

// Checks that the state folder can be used, or created; that no other daemon
// uses it; and that its database, if there is one, is a readable file of this
// program. Changes nothing. The errors say what to do.
absl::Status CheckStateFolder(const std::filesystem::path& folder);

// Checks that each address can be opened: host:port and insecure:host:port by
// binding the port for a moment, unix:/path by its folder, which must exist
// unless it is the state folder, and by what is there. `listen` as in
// ServerOptions; `ports` are "host:port" for others.
absl::Status CheckAddresses(const std::filesystem::path& state_folder,
                            const std::vector<std::string>& listen,
                            const std::vector<std::string>& ports);

}  // namespace selfcal::server
