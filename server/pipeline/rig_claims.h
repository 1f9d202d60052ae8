// The rigs whose work this daemon does: all of them, or, where several daemons
// share the database, those that it has claimed (server/store/rig_claim.h). It
// claims some of the rigs that have work and no daemon, the fewer the more it
// has to do, and gives up those that have had none for a while.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <functional>
#include <mutex>
#include <optional>
#include <string>

#include "server/pipeline/arriving_rigs.h"
#include "server/pipeline/backoff.h"
#include "server/pipeline/held_claims.h"
#include "server/pipeline/other_replicas.h"
#include "server/pipeline/periodic_thread.h"
#include "server/pipeline/pipeline.h"
#include "server/store/rig_claim.h"

namespace selfcal::server {

class RigClaims {
 public:
  // `on_beat` is called, on a thread of its own, with each beat and after each
  // claim: there may be more to do, and others may have done what was waiting.
  // `store` must outlive it.
  RigClaims(Store* store,
            const ReplicaOptions& options,
            std::function<void()> on_beat);
  ~RigClaims();

  absl::Status Start();
  // Ends the thread, and leaves the rigs to the others.
  void Stop();

  // Name of this daemon in the records of claims; empty if it does the work of
  // all rigs.
  std::string replica() const;
  // nullopt if the work of the rig is not this daemon's.
  std::optional<RigClaim> Find(const std::string& rig) const;
  // False once it is known that the claim does not hold.
  bool Holds(const RigClaim& claim) const;
  // True for one daemon of the database, but for the moments in which it
  // changes: for what one of them has to look after.
  bool IsFirst() const;
  // The rig, which this daemon has not claimed, has work and perhaps no daemon.
  void Wake(const std::string& rig);
  // False while the database that is shared has not responded for several
  // beats.
  bool Responds() const;

 private:
  using Clock = std::chrono::steady_clock;

  // A pass of the thread, with the pause after it, also if it fails.
  std::chrono::milliseconds PassOrBackOff(Backoff* backoff);
  // Returns how long to wait before the next pass.
  absl::StatusOr<std::chrono::milliseconds> Pass();
  absl::Status Begin();
  absl::Status Beat();
  absl::Status RemoveSilent();
  // Notes which claims have work, gives up the others, and claims anew what the
  // database holds for this daemon without its knowledge.
  absl::Status Review();
  // Unless another daemon holds it, or it is gone.
  absl::Status Claim(const std::string& rig);
  // Returns whether it has left rigs to others.
  absl::StatusOr<bool> ClaimMore();

  Store* const store_;
  const ReplicaOptions options_;
  const std::function<void()> on_beat_;
  HeldClaims held_;
  ArrivingRigs arriving_;
  // The next three are used by the thread alone.
  OtherReplicas others_;
  Clock::time_point next_beat_;
  int busy_ = 0;  // claims with work

  mutable std::mutex mutex_;  // guards the next two
  bool is_first_ = false;
  Clock::time_point responded_;

  PeriodicThread thread_;
};

}  // namespace selfcal::server
