#include "core/coach/plan.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "core/coach/words.h"
#include "core/information/group_scorer.h"
#include "core/information/rig_components.h"
#include "core/information/unobserved.h"
#include "core/model/symmetric_eigen.h"

namespace selfcal {
namespace {

// A segment that reduces what is missing by a smaller part teaches none of it.
constexpr double kLeastProgress = 0.02;

// Information is about the free components, in units of the limit: a direction
// with at least 1 is learned.
class Planner {
 public:
  Planner(const Rig& rig, const Predictions& predictions, const PlanGoal& goal)
      : components_(rig),
        limits_(goal.learned_below * PriorSigmas(rig)(components_.free())),
        learned_below_(goal.learned_below),
        least_segments_(goal.segments),
        predictions_(predictions),
        segments_(predictions.motions.size(), 0) {
    for (const MotionPrediction& motion : predictions.motions) {
      lessons_.push_back(InLimits(motion.Lambda));
    }
  }

  Plan Make(const Eigen::MatrixXd& known) {
    const Eigen::MatrixXd now = InLimits(known);
    Eigen::MatrixXd after = now;
    for (int i = 0; i < kMostPlannedSegments; ++i) {
      auto next = MostProgress(after);
      if (next == lessons_.size()) {
        if (i >= least_segments_) break;
        next = LargestGain(after);
      }
      after += lessons_[next];
      ++segments_[next];
    }
    return {Lessons(), Missing(now, after)};
  }

 private:
  Eigen::MatrixXd InLimits(const Eigen::MatrixXd& Lambda) const {
    return limits_.asDiagonal() *
           Lambda(components_.free(), components_.free()) *
           limits_.asDiagonal();
  }

  // Entropy beyond the limits [nat].
  static double Lacking(const Eigen::MatrixXd& information) {
    return -0.5 * SymmetricEigenvalues(information).array().min(1).log().sum();
  }

  std::size_t LargestGain(const Eigen::MatrixXd& information) const {
    std::size_t best = 0;
    double most = 0;
    for (std::size_t i = 0; i < lessons_.size(); ++i) {
      const double log_det =
          SymmetricEigenvalues(information + lessons_[i]).array().log().sum();
      if (i > 0 && log_det <= most) continue;
      most = log_det;
      best = i;
    }
    return best;
  }

  // The motion that teaches most of what is missing, of several one that is
  // planned already; none if nothing is missing, or if no motion teaches it.
  std::size_t MostProgress(const Eigen::MatrixXd& information) const {
    std::size_t best = lessons_.size();
    double least = (1 - kLeastProgress) * Lacking(information);
    for (std::size_t i = 0; i < lessons_.size(); ++i) {
      const double lacking = Lacking(information + lessons_[i]);
      const bool same = best < lessons_.size() && lacking == least;
      if (same ? segments_[i] <= segments_[best] : lacking >= least) continue;
      least = lacking;
      best = i;
    }
    return best;
  }

  std::vector<Lesson> Lessons() const {
    std::vector<Lesson> planned;
    for (std::size_t i = 0; i < segments_.size(); ++i) {
      const MotionPrediction& motion = predictions_.motions[i];
      if (segments_[i] == 0) continue;
      planned.push_back({motion.motion, motion.instruction, segments_[i]});
    }
    std::stable_sort(
        planned.begin(), planned.end(), [](const Lesson& a, const Lesson& b) {
          return a.segments > b.segments;
        });
    return planned;
  }

  std::vector<MissingDirection> Missing(const Eigen::MatrixXd& now,
                                        const Eigen::MatrixXd& after) const {
    std::vector<MissingDirection> missing;
    for (UnobservedDirection& direction :
         AnalyseObservability(now, components_.free_names()).unobserved) {
      const Eigen::VectorXd vector = VectorOf(direction);
      missing.push_back({DirectionInWords(direction),
                         std::move(direction.parts),
                         Sigma(vector, now),
                         Sigma(vector, after),
                         TeacherOf(vector, after)});
    }
    std::stable_sort(missing.begin(),
                     missing.end(),
                     [](const MissingDirection& a, const MissingDirection& b) {
                       return a.sigma > b.sigma;
                     });
    return missing;
  }

  // The part of the direction that the parts name.
  Eigen::VectorXd VectorOf(const UnobservedDirection& direction) const {
    Eigen::VectorXd vector = Eigen::VectorXd::Zero(limits_.size());
    const auto& names = components_.free_names();
    for (const UnobservedDirection::Part& part : direction.parts) {
      const auto at = std::find(names.begin(), names.end(), part.component);
      vector[at - names.begin()] = part.weight;
    }
    return vector.normalized();
  }

  double Sigma(const Eigen::VectorXd& direction,
               const Eigen::MatrixXd& information) const {
    DefiniteMatrix factored;
    factored.Factor(information);
    return learned_below_ * std::sqrt(factored.InverseSquare(direction));
  }

  std::string_view TeacherOf(const Eigen::VectorXd& direction,
                             const Eigen::MatrixXd& after) const {
    std::string_view teacher;
    double largest = 0;
    for (std::size_t i = 0; i < segments_.size(); ++i) {
      if (segments_[i] == 0) continue;
      const double sigma = Sigma(direction, after - segments_[i] * lessons_[i]);
      if (sigma <= largest) continue;
      largest = sigma;
      teacher = predictions_.motions[i].motion;
    }
    return teacher;
  }

  const RigComponents components_;
  const Eigen::VectorXd limits_;  // of the free components
  const double learned_below_;
  const int least_segments_;
  const Predictions& predictions_;
  std::vector<Eigen::MatrixXd> lessons_;  // one segment of each motion
  std::vector<int> segments_;             // planned, of each motion
};

}  // namespace

Plan MakePlan(const Rig& rig,
              const Predictions& predictions,
              const Eigen::MatrixXd& known,
              const PlanGoal& goal) {
  return Planner(rig, predictions, goal).Make(known);
}

}  // namespace selfcal
