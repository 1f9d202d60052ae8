// The rules of selfcald: what happens to rigs, segments, runs and calibrations,
// and when. Each method is one transaction of the store (store.h), or one state
// of it, carried out by the functions of this module; errors are those of the
// store.
//
// Any thread may call. What waits for nothing is named Begin...
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/calibration/remembered_segment.h"
#include "core/information/segment_ends.h"
#include "core/information/segment_information.h"
#include "core/model/rig.h"
#include "core/model/segment.h"
#include "server/domain/clock.h"
#include "server/domain/domain_options.h"
#include "server/domain/memory.h"
#include "server/domain/quarantine.h"
#include "server/domain/rig_update.h"
#include "server/domain/score_commit.h"
#include "server/store/store.h"

namespace selfcal::server {

enum class PutVerdict { kStored, kDuplicate };

class Domain {
 public:
  // `store` must outlive it. `clock` gives the time that is stamped on what is
  // written.
  explicit Domain(Store* store,
                  const DomainOptions& options = {},
                  Clock clock = NowNs)
      : store_(store), options_(options), clock_(std::move(clock)) {}

  Store* store() const { return store_; }

  // --- Rigs. Creates the rig with its factory calibration as version 1,
  // active, and its empty tables. ALREADY_EXISTS; RESOURCE_EXHAUSTED where the
  // quota of rigs leaves no room.
  absl::StatusOr<StoredRig> CreateRig(const StoredRig& rig);
  absl::StatusOr<StoredRig> CreateRig(const Rig& rig,
                                      const RigPolicy& policy = {}) {
    return CreateRig(StoredRig{rig, 0, policy});
  }

  // UpdateRig of rig_update.h.
  absl::StatusOr<RigUpdate> UpdateRig(const std::string& rig,
                                      const RigChange& change,
                                      const std::string& caller);
  // DeleteRig of deletion.h.
  absl::StatusOr<int> DeleteRig(const std::string& rig,
                                const std::string& caller,
                                const std::string& reason);

  // --- Segments. `segment` must be valid for the rig. The same key again
  // changes nothing. RESOURCE_EXHAUSTED where a quota leaves no room.
  absl::StatusOr<PutVerdict> PutSegment(const std::string& rig,
                                        const MotionSegment& segment);
  // The same without waiting for the disk. What one thread puts is stored in
  // that order. `done` is called once: on this thread where the segment is
  // refused before it is written, else on one of the store's; it must be short
  // and not call the store.
  using PutDone = std::function<void(const absl::StatusOr<PutVerdict>&)>;
  void BeginPutSegment(const std::string& rig,
                       const MotionSegment& segment,
                       PutDone done);

  // Writes the information of one stored segment, and its ends where they are
  // known; removes entries from the tables that were too old when it arrived;
  // offers it to the tables; tests the newest segments for a device change
  // (core/change); deletes data that is not needed any more; and creates the
  // run that the tables call for, if no run is unfinished. A segment that is
  // scored already changes nothing. After a device change the segments from
  // before leave all tables, and a run that was created before it ends with a
  // rejected calibration.
  absl::StatusOr<ScoreCommit> CommitScore(
      const std::string& rig,
      const SegmentKey& key,
      const SegmentInformation& information,
      const std::optional<SegmentEnds>& ends = std::nullopt);

  // Replaces the score of a scored segment by a later one, also in the tables
  // that hold it. Changes nothing where its data is gone.
  absl::Status ReplaceScore(const std::string& rig,
                            const SegmentKey& key,
                            const SegmentInformation& information,
                            const SegmentEnds& ends);

  // Takes a segment that cannot be used out of the queue and out of the tables
  // for good, and deletes its data unless an unfinished run references it. An
  // event records the problem. A segment that is unusable already stays as it
  // is.
  absl::Status MarkUnusable(const std::string& rig,
                            const SegmentKey& key,
                            const std::string& problem);

  // The same by an operator, for one segment of a session or for all that are
  // stored: an event records who did it and why. A run under way that uses one
  // of them ends with a rejected calibration. NOT_FOUND if nothing is stored of
  // it.
  // DeleteSegment of deletion.h.
  absl::StatusOr<bool> DeleteSegment(const std::string& rig,
                                     const SegmentKey& key,
                                     const std::string& caller,
                                     const std::string& reason);
  absl::StatusOr<QuarantineCommit> QuarantineSegments(
      const std::string& rig,
      const std::string& session,
      std::optional<std::int64_t> index,
      const std::string& caller,
      const std::string& reason);

  // What is known of segments beside the data of those that the run uses, in
  // the order of time, each session in one run: of those without data their
  // ends (of the newest kRemembered), of the others that they are there. None
  // from before its device change, and no misfits.
  absl::StatusOr<std::vector<RememberedSegment>> ListRemembered(
      const std::string& rig, std::int64_t run);

  // Scored segments that the run does not use: first those with data (the
  // reserve, kReserve), each part newest first. None from before its device
  // change, none whose information is damaged.
  absl::StatusOr<std::vector<HeldOut>> ListHeldOut(const std::string& rig,
                                                   std::int64_t run,
                                                   int limit);

  // --- Calibrations. Activates a version manually; an event records who did it
  // and why. What was active becomes superseded, or rolled back if it is the
  // newer of the two. The version that is active already changes nothing.
  // FAILED_PRECONDITION for a candidate or a rejected one.
  absl::StatusOr<StoredCalibration> ActivateCalibration(
      const std::string& rig,
      std::int64_t version,
      const std::string& caller,
      const std::string& reason);

  // Records what a verification found, by which the two cores disagree, with
  // the version that it concerns and in an event. A version keeps the first
  // finding.
  absl::Status ReportDisagreement(const std::string& rig,
                                  std::int64_t version,
                                  const std::string& finding);

  // --- Runs. On the tables as they are. FAILED_PRECONDITION if they are empty,
  // a run of the rig is unfinished, or, without `force`, a version was computed
  // on the same tables, from the version that is active or to become it.
  absl::StatusOr<StoredRun> CreateManualRun(const std::string& rig,
                                            bool force = false);
  // Of every rig whose calibration is older than its policy allows
  // (age_trigger.h).
  absl::StatusOr<std::vector<StoredRun>> StartAgedRuns(std::int64_t now_ns);
  // Of every rig whose session has ended (session_trigger.h): it is one of
  // `ended`, or its newest segment arrived before `idle_since_ns`.
  absl::StatusOr<std::vector<StoredRun>> StartSessionRuns(
      const std::vector<std::string>& ended, std::int64_t idle_since_ns);
  // Records why a pending run is deferred; the first time with an event.
  absl::Status HoldRun(const std::string& rig,
                       std::int64_t run,
                       const std::string& reason);
  // Pending or running -> running, one attempt more.
  absl::StatusOr<StoredRun> BeginRun(const std::string& rig, std::int64_t run);
  // Running -> pending, the attempt not counted: an orderly stop gives it back.
  absl::StatusOr<StoredRun> ReleaseRun(const std::string& rig,
                                       std::int64_t run);
  // Stores what a running run has found as the next version, a candidate; where
  // it has one already, changes nothing and returns that. The version is
  // assigned here.
  absl::StatusOr<StoredCalibration> StoreCandidate(
      const std::string& rig,
      std::int64_t run,
      const StoredCalibration& calibration);
  // Ends a running run with its calibration, stored as a candidate if it was
  // not yet: active (the one before becomes superseded) or rejected, as its
  // state, reasons and validation say. ABORTED if it was validated against
  // another version than is active now. Deletes data that only the run
  // referenced. May create the next run, as CommitScore does. Where it becomes
  // active, segments that its report excludes (SegmentFit::excluded) are
  // quarantined. It is rejected where the device has changed, or a segment of
  // the run was quarantined, since the run was created. Where its report shows
  // surely enough for DomainOptions::change that the device changed among its
  // segments (EvictedUse::split) that is a device change, as in CommitScore,
  // and none of them is quarantined.
  absl::StatusOr<StoredCalibration> FinishRun(
      const std::string& rig,
      std::int64_t run,
      const StoredCalibration& calibration);
  // Ends it without a calibration: kFailed or kCancelled. Its candidate is
  // rejected, with the message.
  absl::StatusOr<StoredRun> EndRun(const std::string& rig,
                                   std::int64_t run,
                                   RunState state,
                                   const std::string& message);

 private:
  Store* const store_;
  const DomainOptions options_;
  const Clock clock_;
};

}  // namespace selfcal::server
