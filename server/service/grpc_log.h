// What gRPC itself has to say goes into the daemon's log.
#pragma once

namespace selfcal::server {

// For the whole process, into the logger that is the default one now. A second
// call does nothing.
void RouteGrpcLog();

}  // namespace selfcal::server
