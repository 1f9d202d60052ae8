#include "core/calibration/calibrate.h"

#include <algorithm>
#include <utility>

#include "core/calibration/calibration_run.h"
#include "core/calibration/clock_start.h"
#include "core/calibration/partition.h"
#include "core/calibration/segment_agreement.h"
#include "core/information/segment_scorer.h"

namespace selfcal {
namespace {

// Limits the number of calibrations after segments were excluded.
constexpr int kMaxRounds = 3;

std::string CheckInput(const Rig& rig,
                       const Calibration& theta_start,
                       const CalibrateOptions& options,
                       const std::vector<const MotionSegment*>& sorted) {
  if (sorted.empty()) {
    return "no segments to calibrate on";
  }
  if (!SameShape(rig.factory, theta_start)) {
    return "the calibration to start from has other cameras than the rig";
  }
  const std::optional<ThetaPrior>& prior = options.prior;
  if (prior && (!SameShape(rig.factory, prior->centre) ||
                prior->information.rows() != TangentSize(rig.factory) ||
                prior->information.cols() != TangentSize(rig.factory) ||
                !prior->information.allFinite())) {
    return "the prior on theta does not have the shape of the rig";
  }
  const int size = TangentSize(rig.factory);
  const bool whole = std::all_of(
      options.remembered.begin(), options.remembered.end(), [&](auto& one) {
        return !one.ends || (SameShape(rig.factory, one.ends->theta0) &&
                             one.ends->Lambda.rows() == size + kEndUnknowns &&
                             one.ends->Lambda.cols() == size + kEndUnknowns &&
                             one.ends->eta.size() == size + kEndUnknowns);
      });
  if (!whole || (options.walk.size() > 0 && options.walk.size() != size)) {
    return "what is remembered of segments does not have the shape of the rig";
  }
  for (std::size_t i = 1; i < sorted.size(); ++i) {
    if (sorted[i - 1]->key == sorted[i]->key) {
      return "segment " + sorted[i]->key.session + "/" +
             std::to_string(sorted[i]->key.index) + " is given twice";
    }
  }
  return "";
}

// The used segments, and the reasons for the exclusion of the others.
class Selection {
 public:
  explicit Selection(const std::vector<const MotionSegment*>& segments)
      : all_(segments), reasons_(segments.size()) {}

  std::vector<const MotionSegment*> used() const {
    std::vector<const MotionSegment*> used;
    for (std::size_t i = 0; i < all_.size(); ++i) {
      if (reasons_[i].empty()) used.push_back(all_[i]);
    }
    return used;
  }

  // Excludes segments; indices refer to the currently used ones.
  void Exclude(const std::vector<Contradiction>& contradictions) {
    std::vector<std::size_t> used;
    for (std::size_t i = 0; i < all_.size(); ++i) {
      if (reasons_[i].empty()) used.push_back(i);
    }
    for (const Contradiction& one : contradictions) {
      reasons_[used[one.segment]] = one.reason;
    }
  }

  // Adds the excluded ones; sorts by key.
  void Complete(std::vector<SegmentFit>* fits) const {
    for (std::size_t i = 0; i < all_.size(); ++i) {
      if (reasons_[i].empty()) continue;
      SegmentFit& fit = fits->emplace_back();
      fit.key = all_[i]->key;
      fit.excluded = reasons_[i];
    }
    std::sort(fits->begin(), fits->end(), [](const auto& a, const auto& b) {
      return a.key < b.key;
    });
  }

 private:
  const std::vector<const MotionSegment*>& all_;
  std::vector<std::string> reasons_;
};

std::vector<Contradiction> FindMisfitsOf(
    const Rig& rig,
    const Calibration& theta,
    const std::vector<const MotionSegment*>& segments) {
  std::vector<double> fits;
  SegmentScorer scorer;
  SegmentInformation information;
  for (const MotionSegment* segment : segments) {
    scorer.Score(rig, theta, *segment, {}, &information);
    fits.push_back(information.residuals.fit);
  }
  return FindMisfits(fits);
}

// Completes the result, if there is one, by the information of segments without
// data.
void CompleteWithRemembered(const Rig& rig,
                            const std::vector<const MotionSegment*>& used,
                            const CalibrateOptions& options,
                            CalibrationRun* run) {
  if (run->evidence.empty() || options.remembered.empty()) return;
  CompletedEstimate completed =
      FuseRemembered(rig,
                     run->estimate,
                     used,
                     options.remembered,
                     {.walk = options.walk, .changing = options.changing});
  CalibrationResult& result = run->result;
  result.remembered = std::move(completed.use);
  if (completed.covariance.size() == 0) return;
  result.covariance_of_data = std::move(result.covariance);
  result.theta = std::move(completed.theta);
  result.covariance = std::move(completed.covariance);
  result.Lambda += completed.Lambda;
}

// Calibrates, excludes segments that contradict the rest, and calibrates again.
CalibrationResult CalibrateOnWhatAgrees(
    const Rig& rig,
    const Calibration& theta_start,
    const std::vector<const MotionSegment*>& segments,
    const CalibrateOptions& options,
    const ProgressCallback& progress) {
  Selection selection(segments);
  selection.Exclude(FindMisfitsOf(rig, theta_start, segments));
  CalibrationRun run;
  int iterations = 0;
  for (int round = 0;; ++round) {
    const ProgressCallback counted = [&](CalibrateProgress made) {
      made.iteration += iterations;
      made.max_iterations += iterations;
      return !progress || progress(made);
    };
    run = RunCalibration(rig, theta_start, selection.used(), options, counted);
    run.result.iterations += iterations;
    iterations = run.result.iterations;
    if (round == kMaxRounds) break;
    // Segments that contradict the rest may be the reason why it did not
    // converge; there is no evidence if it was cancelled or failed.
    const std::vector<Contradiction> contradictions = FindContradictions(
        run.evidence, run.result.status == CalibrateStatus::kConverged);
    if (contradictions.empty()) break;
    selection.Exclude(contradictions);
  }
  CompleteWithRemembered(rig, selection.used(), options, &run);
  selection.Complete(&run.result.segment_fits);
  return std::move(run.result);
}

}  // namespace

CalibrationResult Calibrate(const Rig& rig,
                            const Calibration& theta_start,
                            const std::vector<MotionSegment>& segments,
                            const CalibrateOptions& options,
                            const ProgressCallback& progress) {
  std::vector<const MotionSegment*> sorted = SortByKey(segments);
  const std::string problem = CheckInput(rig, theta_start, options, sorted);
  if (!problem.empty()) {
    CalibrationResult result;
    result.message = problem;
    result.theta = theta_start;
    return result;
  }
  Calibration theta = theta_start;
  std::vector<MotionSegment> moved;
  StartAtOffsets(rig, &theta, &sorted, &moved);
  if (options.exclude_contradictions) {
    return CalibrateOnWhatAgrees(rig, theta, sorted, options, progress);
  }
  CalibrationRun run = RunCalibration(rig, theta, sorted, options, progress);
  CompleteWithRemembered(rig, sorted, options, &run);
  return std::move(run.result);
}

}  // namespace selfcal
