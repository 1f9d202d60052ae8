#include "core/calibration/memory_split.h"

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "core/change/change_mixture.h"
#include "core/change/concerned.h"
#include "core/change/course.h"
#include "core/change/group_concern.h"
#include "core/change/theta_parts.h"

namespace selfcal {
namespace {

constexpr int kLongestPart = 4;   // segments
constexpr int kFewest = 2;        // segments on either side of a step
constexpr int kShortestRamp = 3;  // parts
// Fraction of a drift that is near enough to the present state of the device.
constexpr double kDrifted = 2.0 / 3;
// A drift explains a difference as well as a step if its test is less probable
// than this multiple of that of the step.
constexpr double kAsGood = 100;
// A group is concerned if its test is less probable than this.
constexpr double kConcerned = 0.01;
// The prior probability that a device changed while its segments were recorded.
constexpr double kChanged = 0.5;
// The prior probability that groups that have changed continue to change.
constexpr double kContinues = 0.5;

// Joined segments of one session, by index.
struct Part {
  int first = 0;
  int count = 0;
};

// A course to be tested.
struct Trial {
  ChangeKind kind = ChangeKind::kSudden;
  Eigen::VectorXd weights;  // by part
  // Its share of the level of tests and of the prior of a change.
  double share = 1;
};

// The size of the next longer course to test.
int NextLonger(int n) { return n + std::max(1, n / 2); }

bool BeginSession(std::span<const JoinedSegment> segments, int i) {
  return i == 0 ||
         segments[i].ends->key.session != segments[i - 1].ends->key.session;
}

// Cuts each session into parts of nearly equal size.
std::vector<Part> Cut(std::span<const JoinedSegment> segments) {
  const auto count = static_cast<int>(segments.size());
  std::vector<Part> parts;
  for (int begin = 0, end = 0; begin < count; begin = end) {
    end = begin + 1;
    while (end < count && !BeginSession(segments, end)) ++end;
    const int pieces = (end - begin + kLongestPart - 1) / kLongestPart;
    for (int k = 0; k < pieces; ++k) {
      const int first = begin + k * (end - begin) / pieces;
      parts.push_back(
          {first, begin + (k + 1) * (end - begin) / pieces - first});
    }
  }
  return parts;
}

std::vector<Trial> Trials(std::span<const JoinedSegment> segments,
                          const std::vector<Part>& parts) {
  const auto count = static_cast<int>(parts.size());
  const auto total = static_cast<int>(segments.size());
  const auto is_step = [&](int newest) {
    const int first = parts[count - newest].first;
    return first >= kFewest && total - first >= kFewest;
  };
  std::vector<Trial> between, within, ramps;
  for (int n = 1; n < count; ++n) {
    if (is_step(n) && BeginSession(segments, parts[count - n].first)) {
      between.push_back({ChangeKind::kSudden, StepCourse(count, n)});
    }
  }
  for (int n = 1; n < count; n = NextLonger(n)) {
    if (is_step(n))
      within.push_back({ChangeKind::kSudden, StepCourse(count, n)});
  }
  for (int n = kShortestRamp; n <= count; n = NextLonger(n)) {
    ramps.push_back({ChangeKind::kDrift, RampCourse(count, n)});
  }
  std::vector<Trial> trials;
  const auto add = [&](std::vector<Trial>& some, double share) {
    for (Trial& trial : some) {
      trial.share = share / static_cast<double>(some.size());
      trials.push_back(std::move(trial));
    }
  };
  add(between, 0.5);
  add(within, 0.25);
  add(ramps, 0.25);
  return trials;
}

class SplitSearch {
 public:
  SplitSearch(const Rig& rig,
              const Calibration& theta,
              const Eigen::MatrixXd& estimated,
              double excess,
              std::span<const JoinedSegment> segments,
              const RememberedOptions& options)
      : rig_(rig),
        theta_(theta),
        free_(FreeComponents(rig)),
        directions_(estimated(free_, Eigen::all)),
        onto_(directions_.transpose() * PriorSigmas(rig)(free_).asDiagonal()),
        prior_(Eigen::MatrixXd::Identity(onto_.cols(), onto_.cols())),
        excess_(excess),
        segments_(segments),
        options_(options),
        theta_parts_(ThetaParts(rig)),
        parts_(Cut(segments)) {
    for (const Part& part : parts_) {
      shown_.push_back(
          InformationAboutOffset(segments.subspan(part.first, part.count)));
    }
  }

  SplitFindings Run() const {
    SplitFindings findings;
    DeviceSplit& best = findings.split;
    const std::vector<Trial> trials = Trials(segments_, parts_);
    if (trials.empty() || onto_.rows() == 0) return findings;
    Tested step, drift;
    ChangeMixture mixture;
    const double others = AddContinuing(&mixture);
    for (const Trial& tried : trials) {
      const CourseInformation seen = InformationOf(tried.weights);
      for (const ThetaPart& one : theta_parts_) {
        const double share = tried.share * one.share;
        AddTo(&mixture, seen, one, others * share);
        const double probability =
            TestSpan(seen.change, one.basis).probability / share;
        Tested& least = tried.kind == ChangeKind::kDrift ? drift : step;
        if (probability < least.probability) {
          least = {probability, &tried, &one};
        }
      }
    }
    findings.doubt = mixture.Doubt();
    const Tested& found = IsDrift(step, drift) ? drift : step;
    if (found.trial == nullptr) return findings;
    best.probability = std::min(step.probability, drift.probability);
    best.kind = found.trial->kind;
    best.block = found.theta_part->name;
    const int first = FirstSince(found.trial->weights);
    best.first = segments_[first].ends->key;
    best.newer = static_cast<int>(segments_.size()) - first;
    if (best.probability < kRareSplit) {
      best.without_one = WithoutOne(found);
      if (step.probability < found.probability) {
        best.without_one = std::min(best.without_one, WithoutOne(step));
      }
      best.concerned = ConcernedNames(FindConcerned(
          GroupParts(rig_), Change(shown_, found.trial->weights), kConcerned));
    }
    return findings;
  }

 private:
  // The least probable test of a kind of change; none has the probability 1.
  struct Tested {
    double probability = 1;
    const Trial* trial = nullptr;
    const ThetaPart* theta_part = nullptr;
  };

  // A step in the middle of a drift can by chance explain it as well, but would
  // keep segments of which it is wrong, and not tell that the device may
  // continue to change. If both explain the difference, it is a drift, unless
  // that would keep segments from before the step.
  bool IsDrift(const Tested& step, const Tested& drift) const {
    if (drift.trial == nullptr) return false;
    if (drift.probability < step.probability) return true;
    return drift.probability < kAsGood * step.probability &&
           FirstSince(drift.trial->weights) >= FirstSince(step.trial->weights);
  }

  // Information about the free components in units of the prior, along the
  // directions.
  OffsetInformation InformationAboutOffset(
      std::span<const JoinedSegment> segments) const {
    const ThetaInformation information =
        InformationOfAll(rig_, theta_, segments, options_);
    const Eigen::MatrixXd Lambda =
        onto_ * information.Lambda(free_, free_) * onto_.transpose();
    return {directions_ * Lambda * directions_.transpose() / excess_,
            directions_ * (onto_ * information.eta(free_)) / excess_};
  }

  // The information of the parts about a change of some course, and the
  // derivative of the present theta with respect to it (in tangent units).
  struct CourseInformation {
    OffsetInformation change;
    Eigen::MatrixXd by_change;
  };
  CourseInformation InformationOf(const Eigen::VectorXd& weights) const {
    const Course course = MakeCourse(shown_, weights, prior_);
    return {course.Change(), OntoTangent(course.OffsetByChange(1))};
  }
  static void AddTo(ChangeMixture* mixture,
                    const CourseInformation& seen,
                    const ThetaPart& theta_part,
                    double prior) {
    mixture->Add(
        theta_part.basis.transpose() * seen.change.Lambda * theta_part.basis,
        theta_part.basis.transpose() * seen.change.eta,
        seen.by_change * theta_part.basis,
        prior);
  }

  // Adds the hypotheses that groups which have changed before continue to
  // change, evenly over all segments. Returns the prior of other changes.
  double AddContinuing(ChangeMixture* mixture) const {
    const auto of = PartsOf(options_.changing);
    if (of.empty()) return kChanged;
    double shares = 0;
    for (const ThetaPart* one : of) shares += one->share;
    const auto parts = static_cast<int>(parts_.size());
    const CourseInformation seen = InformationOf(RampCourse(parts, parts));
    for (const ThetaPart* one : of) {
      AddTo(mixture, seen, *one, kContinues * one->share / shares);
    }
    return (1 - kContinues) * kChanged;
  }

  // Parts whose components all belong to these groups.
  std::vector<const ThetaPart*> PartsOf(
      const std::vector<std::string>& groups) const {
    std::vector<const ThetaPart*> found;
    const std::vector<int> of = ConcernedComponents(rig_, groups);
    for (const ThetaPart& theta_part : theta_parts_) {
      if (std::all_of(theta_part.at.begin(), theta_part.at.end(), [&](int k) {
            return std::binary_search(of.begin(), of.end(), free_[k]);
          })) {
        found.push_back(&theta_part);
      }
    }
    return found;
  }

  // Maps rows of the free components in units of the prior to the tangent,
  // projected on the directions.
  Eigen::MatrixXd OntoTangent(const Eigen::MatrixXd& rows) const {
    const Eigen::VectorXd sigmas = PriorSigmas(rig_);
    Eigen::MatrixXd tangent = Eigen::MatrixXd::Zero(sigmas.size(), rows.cols());
    tangent(free_, Eigen::all) = sigmas(free_).asDiagonal() * directions_ *
                                 (directions_.transpose() * rows);
    return tangent;
  }

  OffsetInformation Change(const std::vector<OffsetInformation>& shown,
                           const Eigen::VectorXd& weights) const {
    return MakeCourse(shown, weights, prior_).Change();
  }

  int FirstSince(const Eigen::VectorXd& weights) const {
    int part = 0;
    while (weights(part) < kDrifted) ++part;
    return parts_[part].first;
  }

  double WithoutOne(const Tested& test) const {
    const Trial& trial = *test.trial;
    const ThetaPart& theta_part = *test.theta_part;
    double largest = 0;
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      const auto part = segments_.subspan(parts_[i].first, parts_[i].count);
      for (std::size_t k = 0; k < part.size(); ++k) {
        std::vector<JoinedSegment> rest(part.begin(), part.end());
        rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(k));
        std::vector<OffsetInformation> shown = shown_;
        shown[i] = InformationAboutOffset(rest);
        largest =
            std::max(largest,
                     TestSpan(Change(shown, trial.weights), theta_part.basis)
                         .probability);
      }
    }
    return std::min(1.0, largest / (trial.share * theta_part.share));
  }

  const Rig& rig_;
  const Calibration& theta_;
  const std::vector<int> free_;
  const Eigen::MatrixXd directions_;  // of free components in prior units
  const Eigen::MatrixXd onto_;        // maps from tangent units to these
  const Eigen::MatrixXd prior_;  // root of its covariance, along the directions
  const double excess_;
  const std::span<const JoinedSegment> segments_;
  const RememberedOptions& options_;
  const std::vector<ThetaPart> theta_parts_;
  const std::vector<Part> parts_;
  std::vector<OffsetInformation> shown_;  // by part
};

}  // namespace

SplitFindings FindSplit(const Rig& rig,
                        const Calibration& theta,
                        const Eigen::MatrixXd& estimated,
                        double excess,
                        std::span<const JoinedSegment> segments,
                        const RememberedOptions& options) {
  return SplitSearch(rig, theta, estimated, excess, segments, options).Run();
}

}  // namespace selfcal
