#include "server/pipeline/coaching.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "core/calibration/segment_agreement.h"
#include "core/selection/tables.h"
#include "server/pipeline/after_change.h"
#include "server/pipeline/candidate_validation.h"
#include "server/pipeline/stored_information.h"
#include "server/status/status_macros.h"
#include "server/store/records.h"

namespace selfcal::server {
namespace {

std::size_t BytesOf(const Predictions& predictions) {
  std::size_t bytes = 0;
  for (const MotionPrediction& motion : predictions.motions) {
    bytes += sizeof(double) * static_cast<std::size_t>(motion.Lambda.size());
  }
  return bytes;
}

// Reads all of them: they are few, and count from 1.
absl::StatusOr<std::optional<StoredChange>> NewestChange(
    Store* store, const std::string& rig) {
  std::optional<StoredChange> newest;
  for (std::int64_t number = 1;; ++number) {
    auto change = store->GetChange(rig, number);
    if (absl::IsNotFound(change.status())) return newest;
    SELFCAL_RETURN_IF_ERROR(change.status());
    newest = *std::move(change);
  }
}

// The information of the segments in the tables that the version was not
// computed on, without what is damaged.
absl::StatusOr<std::vector<SegmentInformation>> InformationSince(
    Store* store,
    const StoredCalibration& active,
    const std::vector<TableEntry>& in_tables) {
  std::vector<SegmentKey> since;
  for (const TableEntry& entry : in_tables) {
    const auto& used = active.segments;
    if (std::find(used.begin(), used.end(), entry.key) == used.end()) {
      since.push_back(entry.key);
    }
  }
  return ListInformation(store, active.rig, since);
}

}  // namespace

absl::StatusOr<RigCoaching> RigCoach::Advise(const std::string& rig_name) {
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, store_->GetRig(rig_name));
  SELFCAL_ASSIGN_OR_RETURN(StoredCalibration active,
                           store_->GetActiveCalibration(rig_name));
  SELFCAL_ASSIGN_OR_RETURN(const std::optional<StoredChange> change,
                           NewestChange(store_, rig_name));
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<Table> tables,
                           store_->GetTables(rig_name));
  const std::vector<TableEntry> in_tables = UnionOfTables(tables);
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<SegmentInformation> since,
                           InformationSince(store_, active, in_tables));
  if (change && active.changed_since == change->change) {
    StoredCalibration before = active;
    if (active.version > change->base_version) {
      SELFCAL_ASSIGN_OR_RETURN(
          before, store_->GetCalibration(rig_name, change->base_version));
    }
    active.covariance = CovarianceAfter(rig.rig, *change, before, since);
  }
  const Eigen::MatrixXd known =
      KnownInformation(rig.rig, active.theta, active.covariance, since);
  if (!known.allFinite()) {
    return absl::FailedPreconditionError(
        "the covariance of the active version is not positive definite; "
        "recalibrate, or make another version active");
  }
  const Kept predictions = PredictionsFor(rig, active);
  PlanGoal goal;
  goal.learned_below = CandidateLimits().observed_below;
  goal.segments = kLeastToAgree - static_cast<int>(in_tables.size());
  return RigCoaching{selfcal::Advise(rig.rig, *predictions, known),
                     MakePlan(rig.rig, *predictions, known, goal),
                     active.version,
                     static_cast<int>(since.size()),
                     predictions->segment_s};
}

RigCoach::Kept RigCoach::PredictionsFor(const StoredRig& rig,
                                        const StoredCalibration& active) {
  const std::string key = SerializeRig(rig) + "/" +
                          std::to_string(active.rig_key) + "/" +
                          std::to_string(active.version);
  if (Kept kept = Find(key)) return kept;
  const std::lock_guard lock(computing_);
  if (Kept kept = Find(key)) return kept;
  const auto predictions =
      std::make_shared<const Predictions>(Predict(rig.rig, active.theta));
  Keep({key, predictions});
  return predictions;
}

RigCoach::Kept RigCoach::Find(const std::string& key) {
  const std::lock_guard lock(mutex_);
  const auto found =
      std::find_if(entries_.begin(), entries_.end(), [&](const Entry& entry) {
        return entry.key == key;
      });
  if (found == entries_.end()) return nullptr;
  entries_.splice(entries_.begin(), entries_, found);
  return found->predictions;
}

void RigCoach::Keep(Entry entry) {
  const std::lock_guard lock(mutex_);
  ++computed_;
  bytes_ += BytesOf(*entry.predictions);
  entries_.push_front(std::move(entry));
  while (bytes_ > max_bytes_) {
    bytes_ -= BytesOf(*entries_.back().predictions);
    entries_.pop_back();
  }
}

int RigCoach::computed() const {
  const std::lock_guard lock(mutex_);
  return computed_;
}

}  // namespace selfcal::server
