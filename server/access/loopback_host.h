// Hosts by which the loopback interface is addressed. A request under another
// name comes from a page that has changed what its name stands for (DNS
// rebinding).
#pragma once

#include <string_view>

namespace selfcal::server {

// Whether the header Host is 127.0.0.1, localhost or [::1], with or without a
// port.
bool IsLoopbackHost(std::string_view host);

}  // namespace selfcal::server
