// The rigs whose work this daemon does: all of them, or, where several daemons
// share the database, those that it has claimed (server/store/rig_claim.h). It
// claims some of the rigs that have work and no daemon, the fewer the more it
// has to do, and gives up those that have had none for a while.
#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "server/pipeline/pipeline.h"
#include "server/store/replicas.h"
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
  // A rig may have work and no daemon.
  void Wake();
  // False while the database that is shared has not responded for several
  // beats.
  bool Responds() const;

 private:
  using Clock = std::chrono::steady_clock;
  struct Held {
    RigClaim claim;
    Clock::time_point idle_since;  // had work up to then
  };
  // The beat of another replica.
  struct Seen {
    std::int64_t beat = 0;
    Clock::time_point since;
  };

  void Run();
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
  std::thread thread_;
  // The next three are used by the thread alone.
  std::map<std::string, Seen> seen_;
  std::optional<Clock::time_point> looked_;  // at the others, the last time
  Clock::time_point next_beat_;

  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  bool running_ = false;
  bool woken_ = false;
  bool is_first_ = false;
  int busy_ = 0;  // claims with work
  Clock::time_point responded_;
  std::string replica_;  // empty while there is no record of it
  std::map<std::string, Held> held_;
};

}  // namespace selfcal::server
