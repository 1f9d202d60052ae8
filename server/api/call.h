// A call, as its handler sees it: without a transport.
#pragma once

#include <functional>

#include "server/access/grants.h"

namespace selfcal::server {

struct Call {
  Caller caller;
  // Returns true if the caller has disconnected. Any thread may call.
  std::function<bool()> cancelled = [] { return false; };
};

}  // namespace selfcal::server
