// Protection against pages of other sites, and host names that resolve to this
// machine, that try to use a server through a user's browser.
#pragma once

#include <absl/status/status.h>

#include <array>
#include <utility>

#include "server/http/http.h"

namespace selfcal::server {

// Headers of every response: the pages load nothing from other sites and cannot
// be framed.
using Header = std::pair<const char*, const char*>;
const std::array<Header, 6>& SecurityHeaders();

// PERMISSION_DENIED on the loopback interface if the header Host is none of its
// names (DNS rebinding).
absl::Status CheckHost(const HttpRequest& request, bool loopback);

}  // namespace selfcal::server
