// Reports to the hub, one after the other. Used by one thread.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "selfcal/v1/uplink.pb.h"
#include "server/api/api.h"
#include "server/pipeline/backoff.h"
#include "server/store/outbox.h"
#include "server/store/store.h"
#include "server/uplink/hub.h"
#include "server/uplink/uplink_options.h"

namespace selfcal::server {

class Reporter {
 public:
  using Time = std::chrono::steady_clock::time_point;

  // All must outlive it. Instructions are carried out by the methods of `api`.
  Reporter(Store* store,
           const Api* api,
           Hub* hub,
           const UplinkOptions& options,
           std::string program_version)
      : store_(store),
        api_(api),
        hub_(hub),
        options_(options),
        program_version_(std::move(program_version)) {}

  struct Round {
    std::int64_t reports = 0;
    std::int64_t bytes = 0;    // of all requests, also of those that failed
    std::int64_t waiting = 0;  // records that are left
    // An error: the hub cannot be reached, or the round is CANCELLED.
    absl::Status status;
    // Why the hub has refused the reports of a rig, the last one if there are
    // several, which are tried again later; empty: it has refused none. Those
    // of the others were sent.
    std::string refusal;
  };
  // Sends one report of each rig that has something to report, or from which
  // the hub has not heard for the interval. Rigs that were never reported begin
  // with all of their records. `pace` is called before each with
  // its bytes, and may wait; false: the daemon is stopping, and the round is
  // CANCELLED. An error is one of the store.
  using Pace = std::function<bool(std::int64_t bytes)>;
  absl::StatusOr<Round> ReportOnce(Time now, const Pace& pace);

 private:
  // What the reporter remembers of a rig, by its key.
  struct Rig {
    Time next{};     // report again at this time, whatever has changed
    Time blocked{};  // after a refusal, nothing is reported before
    Backoff backoff;
    std::string refusal;
    // The hub has asked for all records, and does not have them yet.
    bool begins_anew = false;
    std::map<std::string, v1::InstructionResult> results;  // by name
  };

  absl::Status ReportRig(const ReportedRig& rig,
                         Time now,
                         const Pace& pace,
                         Rig* known,
                         Round* round);
  // Puts all records into the outbox, because the hub asks for them: at once if
  // it may have lost some, but not again and again.
  absl::Status BeginAnew(const std::string& rig,
                         Time now,
                         Rig* known,
                         Round* round);
  // Reports nothing of a rig for a while.
  static void Block(const std::string& refusal,
                    Time now,
                    Rig* known,
                    Round* round);
  v1::InstructionResult CarryOut(const std::string& rig,
                                 const v1::Instruction& instruction) const;

  Store* const store_;
  const Api* const api_;
  Hub* const hub_;
  const UplinkOptions options_;
  const std::string program_version_;
  std::map<std::int64_t, Rig> rigs_;
};

}  // namespace selfcal::server
