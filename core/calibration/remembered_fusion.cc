#include "core/calibration/remembered_fusion.h"

#include <algorithm>
#include <deque>
#include <iterator>
#include <utility>

#include "core/calibration/memory_split.h"
#include "core/calibration/segment_agreement.h"
#include "core/calibration/settled_ends.h"
#include "core/information/segment_scorer.h"

namespace selfcal {
namespace {

// A segment with residuals larger than expected by more than this factor is not
// comparable with the others.
constexpr double kMaxFit = 2;
// Probability that any segment is excluded wrongly.
constexpr double kWrongExclusion = 1e-3;
// A difference that is more probable than this is treated as chance.
constexpr double kLikely = 0.05;

// Information about d, along the determined directions.
struct ReducedInformation {
  Eigen::MatrixXd Lambda;  // r x r
  Eigen::VectorXd eta;     // r
};

// A segment with data, linearised and measured at the estimate.
struct OwnSegment {
  SegmentEnds ends;
  double fit = 1;
};

class Fusion {
 public:
  Fusion(const Rig& rig,
         const DataEstimate& estimate,
         const std::vector<const MotionSegment*>& segments,
         const RememberedOptions& options)
      : rig_(rig),
        at_(estimate),
        theta_(BoxPlus(estimate.reference, estimate.d)),
        by_offset_(ThetaByOffset(estimate.reference, estimate.d)),
        basis_(TangentBasis(rig, estimate.subspace)),
        with_data_(basis_.transpose() * estimate.Lambda * basis_),
        options_(options) {
    options_.noise_scale = estimate.noise_scale;
    SegmentScorer scorer;
    SegmentInformation information;
    for (const MotionSegment* segment : segments) {
      scorer.Score(rig, theta_, *segment, {}, &information);
      own_.push_back({SummariseSettledEnds(rig, theta_, *segment),
                      information.residuals.fit});
    }
  }

  CompletedEstimate Run(const std::vector<RememberedSegment>& remembered) {
    Join(remembered);
    if (basis_.cols() == 0) return std::move(result_);
    std::vector<JoinedSegment> compared = Near();
    ExcludeContradictions();
    RememberedUse& use = result_.use;
    const bool most_contradict = 2 * use.contradicting > use.compared;
    if (most_contradict) {
      use.unused = "most of them contradict the segments whose data is kept";
    }
    // If they are many, they may be of the device before or after a change.
    if (!most_contradict || use.compared < kLeastToAgree) compared = Near();
    const SplitFindings found = Compare(compared);
    if (found.split.probability < kRareSplit) use.split = found.split;
    if (use.unused.empty() && Count() > 0) Add();
    // The doubt is about an estimate from these segments.
    const std::vector<JoinedSegment> based_on =
        use.segments > 0 ? compared : CalibratedOn();
    const auto doubt = based_on.size() == compared.size()
                           ? found.doubt
                           : Compare(based_on).doubt;
    if (doubt) AddDoubt(*doubt);
    return std::move(result_);
  }

 private:
  // Collects the segments of the chain, in its order.
  void Join(const std::vector<RememberedSegment>& remembered) {
    for (const RememberedSegment& one : remembered) {
      const auto own =
          std::find_if(own_.begin(), own_.end(), [&](const auto& segment) {
            return segment.ends.key == one.key;
          });
      if (own != own_.end()) {
        joined_.push_back({&own->ends, true, own->fit, one.time_ns});
      } else if (one.ends && one.fit <= kMaxFit) {
        joined_.push_back({&*one.ends, false, one.fit, one.time_ns});
      }
    }
  }

  std::ptrdiff_t Count() const {
    return std::count_if(joined_.begin(), joined_.end(), [](const auto& one) {
      return !one.calibrated_on;
    });
  }

  // The one without data that was received last.
  SegmentKey Newest() const {
    const JoinedSegment* newest = nullptr;
    for (const JoinedSegment& one : joined_) {
      if (one.calibrated_on) continue;
      if (newest == nullptr || one.time_ns >= newest->time_ns) newest = &one;
    }
    return newest->ends->key;
  }

  SplitFindings Compare(const std::vector<JoinedSegment>& segments) const {
    return FindSplit(
        rig_, theta_, at_.subspace.estimated, at_.excess, segments, options_);
  }

  std::vector<JoinedSegment> CalibratedOn() const {
    std::vector<JoinedSegment> own;
    std::copy_if(joined_.begin(),
                 joined_.end(),
                 std::back_inserter(own),
                 [](const JoinedSegment& one) { return one.calibrated_on; });
    return own;
  }

  // Segments whose linearisation point is near enough for a comparison.
  std::vector<JoinedSegment> Near() const {
    std::vector<JoinedSegment> near;
    std::copy_if(joined_.begin(),
                 joined_.end(),
                 std::back_inserter(near),
                 [&](const JoinedSegment& one) {
                   return !IsTooFar(rig_, *one.ends, theta_);
                 });
    return near;
  }

  Eigen::MatrixXd Covariance(const Eigen::MatrixXd& Lambda) const {
    return at_.excess * by_offset_ *
           CovarianceWithHeld(rig_, at_.subspace, Lambda) *
           by_offset_.transpose();
  }

  // Projects the information on the determined directions.
  ReducedInformation ReducedOf(const ThetaInformation& information) const {
    const Eigen::MatrixXd step = by_offset_ * basis_;
    return {step.transpose() * information.Lambda * step,
            step.transpose() * information.eta};
  }

  AgreementTest TestWithData(const ReducedInformation& one) const {
    return TestAgreement(one.Lambda,
                         one.eta,
                         with_data_,
                         Eigen::VectorXd::Zero(one.eta.size()),
                         at_.excess);
  }

  // Tests each of them separately.
  void ExcludeContradictions() {
    const double limit = kWrongExclusion / static_cast<double>(Count());
    RememberedUse& use = result_.use;
    const auto excluded = std::erase_if(joined_, [&](const JoinedSegment& one) {
      if (one.calibrated_on) return false;
      const RememberedInformation alone =
          InformationOfRemembered(rig_, theta_, {&one, 1}, options_);
      if (alone.segments == 0) return false;
      ++use.compared;
      return TestWithData(ReducedOf(alone.information)).probability < limit;
    });
    use.contradicting = static_cast<int>(excluded);
  }

  void Add() {
    const RememberedInformation found =
        InformationOfRemembered(rig_, theta_, joined_, options_);
    RememberedUse& use = result_.use;
    use.too_far = found.left_out;
    if (found.segments == 0) {
      use.unused = "they were linearised too far from the result";
      return;
    }
    use.agreement = TestWithData(ReducedOf(found.information));
    if (use.agreement.probability < kWrongExclusion) {
      use.unused = "together they contradict the segments whose data is kept";
      return;
    }
    use.segments = found.segments;
    use.newest = Newest();
    use.reach = found.reach;
    // Their weight is reduced if they differ by more than chance explains.
    const double weight = use.agreement.probability < kLikely
                              ? use.agreement.degrees / use.agreement.statistic
                              : 1;
    const Eigen::MatrixXd all = at_.Lambda + weight * by_offset_.transpose() *
                                                 found.information.Lambda *
                                                 by_offset_;
    const Eigen::VectorXd step =
        SubspaceStep(rig_,
                     at_.subspace,
                     all,
                     weight * by_offset_.transpose() * found.information.eta);
    result_.theta = BoxPlus(at_.reference, at_.d + step);
    result_.covariance = Covariance(all);
    result_.Lambda = weight * found.information.Lambda;
  }

  // Accounts for the probability that the device changed.
  void AddDoubt(const ChangeDoubt& doubt) {
    if (result_.use.segments == 0) {
      result_.theta = theta_;
      result_.covariance = Covariance(at_.Lambda);
      result_.Lambda =
          Eigen::MatrixXd::Zero(at_.Lambda.rows(), at_.Lambda.cols());
    }
    result_.theta = BoxPlus(result_.theta, doubt.step);
    result_.covariance += doubt.covariance;
    result_.use.change_probability = doubt.probability;
    result_.use.change_sigmas = doubt.covariance.diagonal().cwiseSqrt();
  }

  const Rig& rig_;
  const DataEstimate& at_;
  const Calibration theta_;
  const Eigen::MatrixXd by_offset_;
  const Eigen::MatrixXd basis_;
  const Eigen::MatrixXd with_data_;
  RememberedOptions options_;
  std::deque<OwnSegment> own_;
  std::vector<JoinedSegment> joined_;
  CompletedEstimate result_;
};

}  // namespace

CompletedEstimate FuseRemembered(
    const Rig& rig,
    const DataEstimate& estimate,
    const std::vector<const MotionSegment*>& segments,
    const std::vector<RememberedSegment>& remembered,
    const RememberedOptions& options) {
  return Fusion(rig, estimate, segments, options).Run(remembered);
}

}  // namespace selfcal
