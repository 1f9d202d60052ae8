// How a device reaches its hub, and what it reports.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "server/access/grants.h"
#include "server/store/outbox.h"

namespace selfcal::server {

struct UplinkOptions {
  // host:port or, without encryption, insecure:host:port or unix:/path; empty:
  // there is no hub.
  std::string hub = {};
  // PEM files. The hub must have a certificate of `ca` (empty: of the
  // authorities of the system); the others are this device's.
  std::string ca = {};
  std::string certificate = {};
  std::string key = {};
  ReportedData data = ReportedData::kNone;
  std::int64_t max_bytes_per_s = 0;  // 0: no limit
  // A report follows after this time also if nothing has changed: it shows the
  // hub that the device is alive, and brings instructions.
  double interval_s = 30;
  // What instructions of the hub may do.
  Role role = Role::kAdminister;

  friend bool operator==(const UplinkOptions&, const UplinkOptions&) = default;
};

}  // namespace selfcal::server
