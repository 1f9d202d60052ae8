// The changes of the store that touch several subjects at once, one transaction
// each. What they mean stands at Store (store.h).
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/store/statement.h"
#include "server/store/store.h"

namespace selfcal::server {

absl::StatusOr<ScoreCommit> CommitScoreRows(
    Connection* db,
    const std::string& rig,
    const SegmentKey& key,
    const SegmentInformation& information,
    const std::optional<SegmentEnds>& ends,
    const ChangeOptions& change);

absl::Status ReplaceScoreRows(Connection* db,
                              const std::string& rig,
                              const SegmentKey& key,
                              const SegmentInformation& information,
                              const SegmentEnds& ends);

absl::Status MarkUnusableRow(Connection* db,
                             const std::string& rig,
                             const SegmentKey& key,
                             const std::string& problem);

absl::StatusOr<QuarantineCommit> QuarantineSegmentRows(
    Connection* db,
    const std::string& rig,
    const std::string& session,
    std::optional<std::int64_t> index,
    const std::string& caller,
    const std::string& reason);

absl::StatusOr<StoredRun> CreateManualRunRow(Connection* db,
                                             const std::string& rig,
                                             bool force);
absl::StatusOr<std::vector<StoredRun>> StartAgedRunRows(Connection* db,
                                                        std::int64_t now_ns);
absl::StatusOr<std::vector<StoredRun>> StartSessionRunRows(
    Connection* db,
    const std::vector<std::string>& ended,
    std::int64_t idle_since_ns);
absl::Status HoldRunRow(Connection* db,
                        const std::string& rig,
                        std::int64_t run,
                        const std::string& reason);
absl::StatusOr<StoredRun> BeginRunRow(Connection* db,
                                      const std::string& rig,
                                      std::int64_t run);
absl::StatusOr<StoredRun> ReleaseRunRow(Connection* db,
                                        const std::string& rig,
                                        std::int64_t run);
absl::StatusOr<StoredCalibration> StoreCandidateRow(
    Connection* db,
    const std::string& rig,
    std::int64_t run,
    const StoredCalibration& calibration);
absl::StatusOr<StoredCalibration> ReadCandidate(Connection* db,
                                                const std::string& rig,
                                                std::int64_t run);
absl::StatusOr<StoredCalibration> ActivateCalibrationRow(
    Connection* db,
    const std::string& rig,
    std::int64_t version,
    const std::string& caller,
    const std::string& reason);

absl::Status ReportDisagreementRow(Connection* db,
                                   const std::string& rig,
                                   std::int64_t version,
                                   const std::string& finding);
absl::StatusOr<StoredCalibration> FinishRunRow(
    Connection* db,
    const std::string& rig,
    std::int64_t run,
    const StoredCalibration& calibration,
    const ChangeOptions& change);
absl::StatusOr<StoredRun> EndRunRow(Connection* db,
                                    const std::string& rig,
                                    std::int64_t run,
                                    RunState state,
                                    const std::string& message);

}  // namespace selfcal::server
