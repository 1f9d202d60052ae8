// What keeps pages of other sites, and names that point here, from using the
// console through somebody's browser.
#pragma once

#include <absl/status/status.h>

#include <array>
#include <utility>

#include "server/console/http.h"

namespace selfcal::server {

// Of every answer: nothing from elsewhere is loaded, nobody frames the pages.
using Header = std::pair<const char*, const char*>;
const std::array<Header, 6>& SecurityHeaders();

// PERMISSION_DENIED on the loopback for a Host that is none of its names (a
// name of somebody else that was made to point here), and for a change without
// the header X-Selfcal-Console, which no page of another site can send.
// UNIMPLEMENTED for methods other than GET, HEAD and POST.
absl::Status CheckOrigin(const HttpRequest& request, bool loopback);

}  // namespace selfcal::server
