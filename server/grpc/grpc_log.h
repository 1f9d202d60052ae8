// Routes the log messages of gRPC and protobuf to the daemon's log.
#pragma once

namespace selfcal::server {

// Applies to the whole process and uses the present default logger. A second
// call does nothing.
void RouteGrpcLog();

// True if an address has stopped accepting connections. gRPC 1.51 stops
// accepting permanently when the process has no file descriptor left for a
// connection, and only reports this in its log.
bool HasStoppedAccepting();

}  // namespace selfcal::server
