#include "server/domain/domain.h"

#include <future>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>

#include "server/domain/alarms.h"
#include "server/domain/calibration_life.h"
#include "server/domain/checks.h"
#include "server/domain/deletion.h"
#include "server/domain/intake.h"
#include "server/domain/offers.h"
#include "server/domain/outdated_scores.h"
#include "server/domain/quotas.h"
#include "server/domain/reports.h"
#include "server/domain/run_creation.h"
#include "server/domain/run_life.h"
#include "server/domain/run_results.h"
#include "server/status/status_macros.h"
#include "server/store/calibrations.h"
#include "server/store/cohorts.h"
#include "server/store/estimates.h"
#include "server/store/events.h"
#include "server/store/report.h"
#include "server/store/rig_checks.h"
#include "server/store/table_rows.h"
#include "server/store/transact.h"

namespace selfcal::server {
namespace {

// Rigs that one pass checks, each in a transaction: runs that are due do not
// wait for all of them.
constexpr int kRigsOfPass = 100;

// Completes a change of the records of a rig.
absl::Status KeepUp(UnitOfWork* tx) {
  SELFCAL_RETURN_IF_ERROR(UpdateAlarms(tx));
  return RequestChecksAfterChange(tx);
}

// TransactFor, with what follows from a change.
template <typename Work>
auto Change(Store* store,
            const RigClaim& claim,
            const Moment& now,
            const Work& work) -> std::invoke_result_t<Work, UnitOfWork*> {
  return TransactFor(
      store,
      claim,
      now,
      [&](UnitOfWork* tx) -> std::invoke_result_t<Work, UnitOfWork*> {
        auto result = work(tx);
        if (result.ok()) SELFCAL_RETURN_IF_ERROR(KeepUp(tx));
        return result;
      });
}

// The same without a result.
template <typename Work>
absl::Status ChangeOnly(Store* store,
                        const RigClaim& claim,
                        const Moment& now,
                        const Work& work) {
  return store->Transact(claim, now, [&](UnitOfWork* tx) {
    const absl::Status status = work(tx);
    return status.ok() ? KeepUp(tx) : status;
  });
}

// The work, unless a device reports the rig.
template <typename Work>
auto OnOwnRig(const Work& work) {
  return [&work](UnitOfWork* tx) -> std::invoke_result_t<Work, UnitOfWork*> {
    SELFCAL_RETURN_IF_ERROR(CheckOwnRig(tx));
    return work(tx);
  };
}

template <typename Work>
auto ChangeOwnRig(Store* store,
                  const RigClaim& claim,
                  const Moment& now,
                  const Work& work) -> std::invoke_result_t<Work, UnitOfWork*> {
  return Change(store, claim, now, OnOwnRig(work));
}

template <typename Work>
absl::Status ChangeOwnRigOnly(Store* store,
                              const RigClaim& claim,
                              const Moment& now,
                              const Work& work) {
  return ChangeOnly(store, claim, now, OnOwnRig(work));
}

using CheckRig = absl::StatusOr<std::optional<StoredRun>> (*)(
    UnitOfWork* tx, std::int64_t until_ns);

// Checks these rigs, and appends the runs that are created.
absl::Status CheckRigs(Store* store,
                       const Clock& clock,
                       const std::vector<std::string>& names,
                       RigCheck check,
                       std::int64_t until_ns,
                       CheckRig look,
                       std::vector<StoredRun>* started) {
  for (const std::string& name : names) {
    auto run = Change(store, name, clock(), [&](UnitOfWork* tx) {
      return look(tx, until_ns);
    });
    if (run.ok()) {
      if (*run) started->push_back(**std::move(run));
    } else if (absl::IsDataLoss(run.status())) {
      // A damaged rig must not hold up the others.
      SELFCAL_RETURN_IF_ERROR(
          store->Transact(name, clock(), [&](UnitOfWork* tx) {
            return SetCheck(tx, check, kNoCheck);
          }));
    } else if (!absl::IsNotFound(run.status())) {
      return run.status();
    }
  }
  return absl::OkStatus();
}

// Checks the rigs whose check is due at this steady time.
absl::Status CheckDueRigs(Store* store,
                          const Clock& clock,
                          RigCheck check,
                          std::int64_t until_ns,
                          CheckRig look,
                          std::vector<StoredRun>* started) {
  SELFCAL_ASSIGN_OR_RETURN(
      const std::vector<std::string> names,
      store->ListRigsToCheck(check, until_ns, kRigsOfPass));
  return CheckRigs(store, clock, names, check, until_ns, look, started);
}

// Writes what these versions lack. Returns of how many; damaged ones stay as
// they are.
absl::StatusOr<int> Complete(Store* store,
                             const Clock& clock,
                             const std::vector<VersionId>& versions,
                             absl::Status (*write)(UnitOfWork*,
                                                   const StoredCalibration&)) {
  int written = 0;
  for (const auto& [rig, version] : versions) {
    const absl::Status status = store->Transact(
        rig,
        clock(),
        [write, number = version](UnitOfWork* tx) -> absl::Status {
          SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration calibration,
                                   ReadCalibration(tx, number));
          return write(tx, calibration);
        });
    if (status.ok()) {
      ++written;
    } else if (!absl::IsNotFound(status) && !absl::IsDataLoss(status)) {
      return status;
    }
  }
  return written;
}

}  // namespace

absl::StatusOr<StoredRig> Domain::CreateRig(const StoredRig& rig) {
  StoredRig stored = rig;
  const Moment now = clock_();
  stored.create_time_ns = now.time_ns;
  SELFCAL_RETURN_IF_ERROR(store_->InsertRig(stored, now, [&](UnitOfWork* tx) {
    SELFCAL_RETURN_IF_ERROR(CheckRigQuota(tx, options_.quotas));
    SELFCAL_RETURN_IF_ERROR(InsertTables(tx, MakeTables(rig.rig)));
    SELFCAL_RETURN_IF_ERROR(AppendEvent(tx, EventKind::kRigCreated, "created"));
    return StoreFactoryCalibration(tx, stored);
  }));
  return stored;
}

absl::StatusOr<RigUpdate> Domain::UpdateRig(const std::string& rig,
                                            const RigChange& change,
                                            const std::string& caller,
                                            const std::string& reason) {
  return ChangeOwnRig(store_, rig, clock_(), [&](UnitOfWork* tx) {
    return server::UpdateRig(tx, change, caller, reason);
  });
}

absl::StatusOr<int> Domain::DeleteRig(const std::string& rig,
                                      const std::string& caller,
                                      const std::string& reason) {
  return Change(store_, rig, clock_(), [&](UnitOfWork* tx) {
    return server::DeleteRig(tx, caller, reason);
  });
}

absl::StatusOr<PutVerdict> Domain::PutSegment(const std::string& rig,
                                              const MotionSegment& segment) {
  const auto verdict =
      std::make_shared<std::promise<absl::StatusOr<PutVerdict>>>();
  BeginPutSegment(rig, segment, [verdict](const auto& answer) {
    verdict->set_value(answer);
  });
  return verdict->get_future().get();
}

void Domain::BeginPutSegment(const std::string& rig,
                             const MotionSegment& segment,
                             PutDone done) {
  auto packed = PackNewSegment(segment);
  if (!packed.ok()) return done(packed.status());
  // Shared by the transaction and its callback.
  struct Put {
    NewSegment segment;
    PutVerdict verdict;
  };
  const auto put =
      std::make_shared<Put>(Put{*std::move(packed), PutVerdict::kStored});
  store_->BeginTransaction(
      rig,
      clock_(),
      [put, quotas = options_.quotas](UnitOfWork* tx) {
        const auto stored = StoreSegment(tx, put->segment, quotas);
        put->verdict = stored.ok() && *stored ? PutVerdict::kStored
                                              : PutVerdict::kDuplicate;
        return stored.status();
      },
      [put, done = std::move(done)](const absl::Status& status) {
        if (status.ok()) {
          done(put->verdict);
        } else {
          done(status);
        }
      });
}

absl::StatusOr<ScoreCommit> Domain::CommitScore(
    const RigClaim& claim,
    const SegmentKey& key,
    const SegmentInformation& information,
    const std::optional<SegmentEnds>& ends) {
  SELFCAL_ASSIGN_OR_RETURN(const auto decided,
                           InspectFor(store_, claim.rig, [&](UnitOfWork* tx) {
                             return DecideJointly(tx, key, information);
                           }));
  return ChangeOwnRig(store_, claim, clock_(), [&](UnitOfWork* tx) {
    return server::CommitScore(
        tx, key, information, ends, decided, options_.change);
  });
}

absl::Status Domain::ReplaceScore(const RigClaim& claim,
                                  const ScoreBasis& basis,
                                  const SegmentKey& key,
                                  const SegmentInformation& information,
                                  const SegmentEnds& ends) {
  return ChangeOwnRigOnly(store_, claim, clock_(), [&](UnitOfWork* tx) {
    return server::ReplaceScore(tx, basis, key, information, ends);
  });
}

absl::Status Domain::NoteOutdatedScores(const RigClaim& claim) {
  return ChangeOwnRigOnly(store_, claim, clock_(), [](UnitOfWork* tx) {
    return server::NoteOutdatedScores(tx);
  });
}

absl::Status Domain::NoteCandidateScores(const RigClaim& claim,
                                         std::int64_t run) {
  return ChangeOwnRigOnly(store_, claim, clock_(), [run](UnitOfWork* tx) {
    return server::NoteCandidateScores(tx, run);
  });
}

absl::Status Domain::EndRescoring(const RigClaim& claim,
                                  const ScoreBasis& basis) {
  return ChangeOwnRigOnly(store_, claim, clock_(), [&](UnitOfWork* tx) {
    return server::EndRescoring(tx, basis);
  });
}

absl::Status Domain::MarkUnusable(const RigClaim& claim,
                                  const SegmentKey& key,
                                  const std::string& problem) {
  return ChangeOwnRigOnly(store_, claim, clock_(), [&](UnitOfWork* tx) {
    return server::MarkUnusable(tx, key, problem);
  });
}

absl::StatusOr<bool> Domain::DeleteSegment(const std::string& rig,
                                           const SegmentKey& key,
                                           const std::string& caller,
                                           const std::string& reason) {
  return ChangeOwnRig(store_, rig, clock_(), [&](UnitOfWork* tx) {
    return server::DeleteSegment(tx, key, caller, reason);
  });
}

absl::StatusOr<QuarantineCommit> Domain::QuarantineSegments(
    const std::string& rig,
    const std::string& session,
    std::optional<std::int64_t> index,
    const std::string& caller,
    const std::string& reason) {
  return ChangeOwnRig(store_, rig, clock_(), [&](UnitOfWork* tx) {
    return server::QuarantineSegments(tx, session, index, caller, reason);
  });
}

absl::StatusOr<std::vector<RememberedSegment>> Domain::ListRemembered(
    const std::string& rig, std::int64_t run) {
  return InspectFor(store_, rig, [&](UnitOfWork* tx) {
    return server::ListRemembered(tx, run);
  });
}

absl::StatusOr<std::vector<HeldOut>> Domain::ListHeldOut(const std::string& rig,
                                                         std::int64_t run,
                                                         int limit) {
  return InspectFor(store_, rig, [&](UnitOfWork* tx) {
    return server::ListHeldOut(tx, run, limit);
  });
}

absl::StatusOr<StoredCalibration> Domain::ActivateCalibration(
    const std::string& rig,
    std::int64_t version,
    const std::string& caller,
    const std::string& reason) {
  return ChangeOwnRig(store_, rig, clock_(), [&](UnitOfWork* tx) {
    return server::ActivateCalibration(tx, version, caller, reason);
  });
}

absl::StatusOr<int> Domain::CompleteEstimates(int limit) {
  SELFCAL_ASSIGN_OR_RETURN(const auto versions,
                           store_->ListWithoutEstimates(limit));
  return Complete(store_, clock_, versions, InsertEstimates);
}

absl::StatusOr<int> Domain::CompleteVersions(int limit) {
  SELFCAL_ASSIGN_OR_RETURN(const auto versions,
                           store_->ListIncompleteVersions(limit));
  return Complete(store_, clock_, versions, WriteListColumns);
}

absl::Status Domain::ReportDisagreement(const std::string& rig,
                                        std::int64_t version,
                                        const std::string& finding) {
  return ChangeOwnRigOnly(store_, rig, clock_(), [&](UnitOfWork* tx) {
    return server::ReportDisagreement(tx, version, finding);
  });
}

absl::StatusOr<StoredRun> Domain::CreateManualRun(const std::string& rig,
                                                  bool force) {
  return ChangeOwnRig(store_, rig, clock_(), [&](UnitOfWork* tx) {
    return server::CreateManualRun(tx, force);
  });
}

absl::StatusOr<std::vector<StoredRun>> Domain::StartTimedRuns(
    std::int64_t now_ns) {
  std::vector<StoredRun> started;
  SELFCAL_RETURN_IF_ERROR(CheckDueRigs(
      store_, clock_, RigCheck::kTime, now_ns, CheckTimes, &started));
  return started;
}

absl::StatusOr<bool> Domain::AreChecksDue(std::int64_t now_ns,
                                          std::int64_t idle_since_ns) {
  SELFCAL_ASSIGN_OR_RETURN(const auto by_time,
                           store_->ListRigsToCheck(RigCheck::kTime, now_ns, 1));
  if (!by_time.empty()) return true;
  if (idle_since_ns <= 0) return false;
  SELFCAL_ASSIGN_OR_RETURN(
      const auto by_session,
      store_->ListRigsToCheck(RigCheck::kSession, idle_since_ns, 1));
  return !by_session.empty();
}

absl::Status Domain::NoteSilentDevices() {
  return store_->RaiseSilent(clock_().time_ns - kSilentAfterNs,
                             BitOf(Alarm::kSilent));
}

absl::Status Domain::NoteOutliers(const CohortFindings& findings, bool all) {
  SELFCAL_ASSIGN_OR_RETURN(const auto before, store_->ListOutliers());
  std::map<std::string, std::int64_t> changes;  // 0: not an outlier any more
  for (const auto& [rig, version] : before) {
    if (all && !findings.contains(rig)) changes[rig] = 0;
  }
  for (const auto& [rig, finding] : findings) {
    const auto known = before.find(rig);
    const std::int64_t noted = known == before.end() ? 0 : known->second;
    if (finding && *finding != noted) changes[rig] = *finding;
  }
  for (const auto& [rig, version] : changes) {
    const absl::Status noted =
        ChangeOnly(store_, rig, clock_(), [version = version](UnitOfWork* tx) {
          SELFCAL_RETURN_IF_ERROR(WriteOutlier(tx, version));
          return StoreAlarms(tx);
        });
    // A rig that is gone is no outlier.
    if (!noted.ok() && !absl::IsNotFound(noted)) return noted;
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<StoredRun>> Domain::StartSessionRuns(
    const std::vector<std::string>& ended, std::int64_t idle_since_ns) {
  std::vector<StoredRun> started;
  // No segment is too new for a session that has ended.
  SELFCAL_RETURN_IF_ERROR(CheckRigs(store_,
                                    clock_,
                                    ended,
                                    RigCheck::kSession,
                                    kNoCheck,
                                    CheckSession,
                                    &started));
  if (idle_since_ns > 0) {
    SELFCAL_RETURN_IF_ERROR(CheckDueRigs(store_,
                                         clock_,
                                         RigCheck::kSession,
                                         idle_since_ns,
                                         CheckSession,
                                         &started));
  }
  return started;
}

absl::Status Domain::DeferRun(const RigClaim& claim,
                              std::int64_t run,
                              const std::string& reason) {
  return ChangeOwnRigOnly(store_, claim, clock_(), [&](UnitOfWork* tx) {
    return server::DeferRun(tx, run, reason);
  });
}

absl::StatusOr<StoredRun> Domain::BeginRun(const RigClaim& claim,
                                           std::int64_t run) {
  return ChangeOwnRig(store_, claim, clock_(), [&](UnitOfWork* tx) {
    return server::BeginRun(tx, run);
  });
}

absl::StatusOr<StoredRun> Domain::ReleaseRun(const RigClaim& claim,
                                             std::int64_t run) {
  return ChangeOwnRig(store_, claim, clock_(), [&](UnitOfWork* tx) {
    return server::ReleaseRun(tx, run);
  });
}

absl::StatusOr<StoredCalibration> Domain::StoreCandidate(
    const RigClaim& claim,
    std::int64_t run,
    const StoredCalibration& calibration) {
  return ChangeOwnRig(store_, claim, clock_(), [&](UnitOfWork* tx) {
    return server::StoreCandidate(tx, run, calibration);
  });
}

absl::StatusOr<StoredCalibration> Domain::FinishRun(
    const RigClaim& claim,
    std::int64_t run,
    const StoredCalibration& calibration,
    const std::string& finding) {
  return ChangeOwnRig(store_, claim, clock_(), [&](UnitOfWork* tx) {
    return server::FinishRun(tx, run, calibration, finding, options_.change);
  });
}

absl::StatusOr<StoredRun> Domain::EndRun(const RigClaim& claim,
                                         std::int64_t run,
                                         RunState state,
                                         const std::string& message) {
  return ChangeOwnRig(store_, claim, clock_(), [&](UnitOfWork* tx) {
    return server::EndRun(tx, run, state, message);
  });
}

absl::StatusOr<ReportAnswer> Domain::TakeReport(const DeviceReport& report) {
  const Moment now = clock_();
  // Ended before the rig is looked for, so that no first report slips in
  // between.
  if (report.deleted) {
    SELFCAL_RETURN_IF_ERROR(store_->EndReports(
        report.key, report.attempt, now.time_ns, kEndOfReportsKept_ns));
  }
  const auto taken = Change(store_, report.rig, now, [&](UnitOfWork* tx) {
    return server::TakeReport(tx, report, options_.quotas);
  });
  const bool is_first = report.number == 1;
  ReportAnswer begin_anew;
  begin_anew.begin_anew = true;
  // The records do not fit those here. If the rig is of another device, that is
  // said in answer to its first report.
  if (absl::IsFailedPrecondition(taken.status()) && !is_first) {
    return begin_anew;
  }
  if (!absl::IsNotFound(taken.status())) return taken;
  if (report.deleted) return ReportAnswer();
  if (!is_first) return begin_anew;
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig,
                           RigOfReport(report.records, report.rig));
  ReportAnswer answer;
  const absl::Status inserted =
      store_->InsertRig(rig, now, [&](UnitOfWork* tx) -> absl::Status {
        SELFCAL_ASSIGN_OR_RETURN(answer,
                                 TakeFirstReport(tx, report, options_.quotas));
        return answer.attempt == 0 ? absl::OkStatus()
                                   : absl::AbortedError("it comes late");
      });
  if (!inserted.ok() && answer.attempt == 0) return inserted;
  return answer;
}

absl::StatusOr<StoredInstruction> Domain::CreateInstruction(
    const std::string& rig,
    const std::string& caller,
    const std::string& request) {
  return Change(store_, rig, clock_(), [&](UnitOfWork* tx) {
    return server::CreateInstruction(tx, caller, request);
  });
}

absl::Status Domain::RecordEvent(EventKind kind, const std::string& detail) {
  const Moment now = clock_();
  return store_->AppendEvent({0, now.time_ns, "", kind, detail, now.steady_ns});
}

}  // namespace selfcal::server
