// What gRPC and protobuf themselves have to say goes into the daemon's log.
#pragma once

namespace selfcal::server {

// For the whole process, into the logger that is the default one now. A second
// call does nothing.
void RouteGrpcLog();

// Whether an address has gone deaf. gRPC 1.51 gives up accepting on it for good
// when the process has no file left for a connection, and says so in its log
// alone.
bool HasStoppedAccepting();

}  // namespace selfcal::server
