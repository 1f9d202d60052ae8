// Protection against pages of other sites, and host names that resolve to this
// machine, that try to use the console through a user's browser.
#pragma once

#include <absl/status/status.h>

#include <array>
#include <utility>

#include "server/console/http.h"

namespace selfcal::server {

// Headers of every response: the pages load nothing from other sites and cannot
// be framed.
using Header = std::pair<const char*, const char*>;
const std::array<Header, 6>& SecurityHeaders();

// Checks the origin of a request. PERMISSION_DENIED on the loopback interface
// if the header Host is none of its names (DNS rebinding), and for a change
// without the header X-Selfcal-Console, which pages of other sites cannot send.
// UNIMPLEMENTED for methods other than GET, HEAD, POST, PATCH and DELETE.
absl::Status CheckOrigin(const HttpRequest& request, bool loopback);

}  // namespace selfcal::server
