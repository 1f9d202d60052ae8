// The rules of selfcald: what happens to rigs, segments, runs and calibrations,
// and when. Each method writes in one transaction of the store (store.h), by
// the functions of this module, or reads one state of it; CommitScore reads
// before it writes, what concerns many rigs (StartTimedRuns, StartSessionRuns,
// NoteOutliers) writes in one for each, and TakeReport tries an existing rig
// before it inserts one. Errors are those of the store.
//
// Any thread may call. All methods that write return after the commit, but for
// BeginPutSegment. Of a rig that a device reports only a report, and DeleteRig,
// change records: FAILED_PRECONDITION for others; its alarms and instructions
// are the hub's own. Those that take a RigClaim are the work of the daemon that
// has claimed the rig: ClaimLost if the claim does not hold any more.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <map>
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
#include "server/domain/quarantine.h"
#include "server/domain/remembered.h"
#include "server/domain/reports.h"
#include "server/domain/rig_update.h"
#include "server/domain/score_commit.h"
#include "server/store/store.h"

namespace selfcal::server {

enum class PutVerdict { kStored, kDuplicate };

// By rig: its version that contradicts its cohort, 0 if none does; nullopt if
// it could not be compared.
using CohortFindings = std::map<std::string, std::optional<std::int64_t>>;

class Domain {
 public:
  // `store` must outlive it. `clock` gives the time of what is written.
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
                                      const std::string& caller,
                                      const std::string& reason = "");
  // DeleteRig of deletion.h.
  absl::StatusOr<int> DeleteRig(const std::string& rig,
                                const std::string& caller,
                                const std::string& reason);

  // --- Segments. `segment` must be valid for the rig. Storing a key again
  // changes nothing. RESOURCE_EXHAUSTED if a quota leaves no room.
  absl::StatusOr<PutVerdict> PutSegment(const std::string& rig,
                                        const MotionSegment& segment);
  // PutSegment without waiting for the disk. Segments of one thread are stored
  // in the order of its calls. `done` is called once: on this thread if the
  // segment is refused before it is written, otherwise on a thread of the
  // store; it must be short and must not call the store.
  using PutDone = std::function<void(const absl::StatusOr<PutVerdict>&)>;
  void BeginPutSegment(const std::string& rig,
                       const MotionSegment& segment,
                       PutDone done);

  // Commits the score of one stored segment: writes its information, and its
  // ends if given; removes misfits, and entries that were too old when it
  // arrived, from the tables; offers it to them if its fit admits it; tests the
  // newest segments for a device change (core/change); creates the run that the
  // tables call for, if no run is unfinished; and deletes data that is no
  // longer needed. Changes nothing if the segment is scored already. After a
  // device change the segments from before it leave all tables, and a run that
  // was created before it ends with a rejected calibration.
  absl::StatusOr<ScoreCommit> CommitScore(
      const RigClaim& claim,
      const SegmentKey& key,
      const SegmentInformation& information,
      const std::optional<SegmentEnds>& ends = std::nullopt);

  // Replaces the score of a scored segment by a later one, also in the tables
  // that hold it. Changes nothing if its data is gone. FAILED_PRECONDITION
  // unless `basis` is the present one: another activation, another prior, or a
  // run that scores at its candidate has scores of its own.
  absl::Status ReplaceScore(const RigClaim& claim,
                            const ScoreBasis& basis,
                            const SegmentKey& key,
                            const SegmentInformation& information,
                            const SegmentEnds& ends);

  // NoteOutdatedScores of outdated_scores.h.
  absl::Status NoteOutdatedScores(const RigClaim& claim);
  // NoteCandidateScores of outdated_scores.h.
  absl::Status NoteCandidateScores(const RigClaim& claim, std::int64_t run);
  // All scored segments whose data is kept, and can be read, have scores of
  // this basis: none is outdated any more. Changes nothing if the basis is not
  // the present one.
  absl::Status EndRescoring(const RigClaim& claim, const ScoreBasis& basis);

  // Marks a segment that cannot be used as unusable: removes it from the queue
  // and from the tables for good, and deletes its data unless an unfinished run
  // references it. An event records the problem. Changes nothing if the segment
  // is unusable already.
  absl::Status MarkUnusable(const RigClaim& claim,
                            const SegmentKey& key,
                            const std::string& problem);

  // DeleteSegment of deletion.h.
  absl::StatusOr<bool> DeleteSegment(const std::string& rig,
                                     const SegmentKey& key,
                                     const std::string& caller,
                                     const std::string& reason);

  // Quarantine by an operator, of one segment of a session or of all that are
  // stored: an event records who did it and why. An unfinished run that uses
  // one of them ends with a rejected calibration. NOT_FOUND if no such segment
  // is stored.
  absl::StatusOr<QuarantineCommit> QuarantineSegments(
      const std::string& rig,
      const std::string& session,
      std::optional<std::int64_t> index,
      const std::string& caller,
      const std::string& reason);

  // Segments known besides the data that the run uses, in order of time, with
  // each session contiguous: for those without data their ends (of the newest
  // kRemembered), for the others only that they exist. None from before its
  // device change, and no misfits.
  absl::StatusOr<std::vector<RememberedSegment>> ListRemembered(
      const std::string& rig, std::int64_t run);

  // Scored segments that the run does not use: first those with data (the
  // reserve among them), then the others, each part newest first. None from
  // before its device change, no misfits, and none whose information is
  // damaged.
  absl::StatusOr<std::vector<HeldOut>> ListHeldOut(const std::string& rig,
                                                   std::int64_t run,
                                                   int limit);

  // --- Calibrations. Activates a version manually; an event records who did it
  // and why. The version that was active becomes superseded, or rolled back if
  // it is the newer of the two. Changes nothing if the version is active
  // already. FAILED_PRECONDITION for a candidate or a rejected version.
  absl::StatusOr<StoredCalibration> ActivateCalibration(
      const std::string& rig,
      std::int64_t version,
      const std::string& caller,
      const std::string& reason);

  // Writes the estimates of at most `limit` versions that have none, from
  // before they were stored with the version. Returns how many it has written.
  absl::StatusOr<int> CompleteEstimates(int limit);
  // The same with the verdict and the temperature by which lists find them.
  absl::StatusOr<int> CompleteVersions(int limit);

  // Records the finding of a verification by which the two cores disagree, with
  // the version concerned and in an event. A version keeps the first finding.
  absl::Status ReportDisagreement(const std::string& rig,
                                  std::int64_t version,
                                  const std::string& finding);

  // --- Runs. Creates a run on the present tables. FAILED_PRECONDITION if they
  // are empty, if a run of the rig is unfinished, or, without `force`, if the
  // newest version of a run was computed on the same tables and started from
  // the active version or is the active one.
  absl::StatusOr<StoredRun> CreateManualRun(const std::string& rig,
                                            bool force = false);
  // Creates the runs that the rules about time start (time_triggers.h), of all
  // rigs that are to be checked (checks.h), at the steady time `now_ns`. Of
  // many, some wait for the next call (AreChecksDue).
  absl::StatusOr<std::vector<StoredRun>> StartTimedRuns(std::int64_t now_ns);
  // True if StartTimedRuns or StartSessionRuns has more to check at these
  // times.
  absl::StatusOr<bool> AreChecksDue(std::int64_t now_ns,
                                    std::int64_t idle_since_ns);
  // Gives an alarm to the rigs whose devices have not reported for a day.
  absl::Status NoteSilentDevices();
  // Gives an alarm to the rigs whose versions contradict their cohorts, as long
  // as these are active, and takes it from those that do not. One that was not
  // compared keeps it, and so does one that is in no cohort unless the findings
  // are of `all` cohorts.
  absl::Status NoteOutliers(const CohortFindings& findings, bool all);
  // Creates the runs of all rigs whose session has ended (session_trigger.h):
  // the rig is one of `ended`, or is to be checked (checks.h) and none of its
  // segments arrived after the steady time `idle_since_ns`; 0: `ended` alone.
  absl::StatusOr<std::vector<StoredRun>> StartSessionRuns(
      const std::vector<std::string>& ended, std::int64_t idle_since_ns);
  // Records why a pending run is deferred; the first time also in an event.
  // FAILED_PRECONDITION if it is not pending.
  absl::Status DeferRun(const RigClaim& claim,
                        std::int64_t run,
                        const std::string& reason);
  // Pending or running -> running, with one attempt more.
  absl::StatusOr<StoredRun> BeginRun(const RigClaim& claim, std::int64_t run);
  // Running -> pending at an orderly stop; the attempt is not counted.
  absl::StatusOr<StoredRun> ReleaseRun(const RigClaim& claim, std::int64_t run);
  // Stores the result of a running run as the next version, a candidate, whose
  // number is assigned here. If the run has a candidate already, changes
  // nothing and returns that.
  absl::StatusOr<StoredCalibration> StoreCandidate(
      const RigClaim& claim,
      std::int64_t run,
      const StoredCalibration& calibration);
  // Ends a running run with its calibration, which is stored as a candidate if
  // it was not yet, and becomes active (the version before becomes superseded)
  // or rejected, as its state, reasons and validation say. ABORTED if it was
  // validated against another version than the one that is active now.
  //
  // The calibration is rejected if the device has changed, or a segment of the
  // run was quarantined, since the run was created. If it becomes active,
  // segments that its report excludes (SegmentFit::excluded) are quarantined.
  // If the report shows with enough certainty for DomainOptions::change that
  // the device changed among the segments of the run (RememberedUse::split),
  // that is a device change, as in CommitScore, and none of them is
  // quarantined.
  //
  // `finding` is what its validation found about the version that stays active
  // (StoredCalibration::finding); empty: nothing. It is recorded with that
  // version, and is one more reason of the one that is rejected.
  //
  // Deletes data that only the run referenced. May create the next run, as
  // CommitScore does.
  absl::StatusOr<StoredCalibration> FinishRun(
      const RigClaim& claim,
      std::int64_t run,
      const StoredCalibration& calibration,
      const std::string& finding = "");
  // Ends a run without a calibration: kFailed or kCancelled. Its candidate, if
  // it has one, is rejected with the message.
  absl::StatusOr<StoredRun> EndRun(const RigClaim& claim,
                                   std::int64_t run,
                                   RunState state,
                                   const std::string& message);

  // --- Reports of devices. Takes what a device reports of one of its rigs, and
  // creates the rig if it is new. INVALID_ARGUMENT for what is no report,
  // FAILED_PRECONDITION if the rig is not the device's, RESOURCE_EXHAUSTED
  // where the quota of rigs leaves no room.
  absl::StatusOr<ReportAnswer> TakeReport(const DeviceReport& report);
  // CreateInstruction of reports.h.
  absl::StatusOr<StoredInstruction> CreateInstruction(
      const std::string& rig,
      const std::string& caller,
      const std::string& request);

  // --- The daemon. Appends an event without a rig.
  absl::Status RecordEvent(EventKind kind, const std::string& detail);

 private:
  Store* const store_;
  const DomainOptions options_;
  const Clock clock_;
};

}  // namespace selfcal::server
