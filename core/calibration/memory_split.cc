#include "core/calibration/memory_split.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <vector>

#include "core/change/chi_square.h"
#include "core/change/group_concern.h"
#include "core/change/parameter_blocks.h"

namespace selfcal {
namespace {

constexpr int kFewest = 2;  // segments on either side
// A block may have no part in what is estimated.
constexpr double kNothing = 1e-9;
// A group is concerned where its test is less probable than this.
constexpr double kConcerned = 0.01;

// Of theta, by the estimated directions.
struct Side {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};

// The newer side less the older one, by the estimated directions.
struct Difference {
  Eigen::VectorXd mean;
  Eigen::MatrixXd information;
};

// How many of the newest: each half as many again as before.
std::vector<int> SplitsOf(int count) {
  std::vector<int> splits;
  for (int newer = kFewest; newer <= count - kFewest;
       newer += std::max(1, newer / 2)) {
    splits.push_back(newer);
  }
  return splits;
}

// Of a difference, if it is one of the block alone.
double ProbabilityOf(const Difference& difference,
                     const Eigen::MatrixXd& block) {
  const Eigen::MatrixXd by_block = block.transpose() * difference.information;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(by_block * block);
  const Eigen::VectorXd along =
      eigen.eigenvectors().transpose() * (by_block * difference.mean);
  double squares = 0;
  int degrees = 0;
  for (Eigen::Index i = 0; i < along.size(); ++i) {
    if (!(eigen.eigenvalues()(i) > kNothing)) continue;
    ++degrees;
    squares += along(i) * along(i) / eigen.eigenvalues()(i);
  }
  return degrees > 0 ? ChiSquareTail(squares, degrees) : 1;
}

class SplitSearch {
 public:
  SplitSearch(const Rig& rig,
              const Calibration& theta,
              const Eigen::MatrixXd& estimated,
              double excess,
              std::span<const JoinedSegment> segments,
              const EvictedOptions& options)
      : rig_(rig),
        theta_(theta),
        free_(FreeComponents(rig)),
        scale_(PriorSigmas(rig)(free_)),
        directions_(estimated(free_, Eigen::all)),
        excess_(excess),
        segments_(segments.begin(), segments.end()),
        options_(options),
        blocks_(ParameterBlocks(rig)) {}

  DeviceSplit Run() {
    DeviceSplit best;
    const ParameterBlock* block = nullptr;
    const std::vector<int> splits =
        SplitsOf(static_cast<int>(segments_.size()));
    tests_ = static_cast<double>(splits.size() * blocks_.size());
    for (const int newer : splits) {
      const Difference difference = Compare(segments_, newer);
      for (const ParameterBlock& one : blocks_) {
        const double probability = Probability(difference, one);
        if (probability < best.probability) {
          best.probability = probability;
          best.newer = newer;
          block = &one;
        }
      }
    }
    if (block == nullptr) return best;
    best.block = block->name;
    best.first = segments_[segments_.size() - best.newer].ends->key;
    if (best.probability < kRareSplit) {
      best.without_one = WithoutOne(best.newer, *block);
      best.concerned = Concerned(Compare(segments_, best.newer));
    }
    return best;
  }

 private:
  double Probability(const Difference& difference,
                     const ParameterBlock& block) const {
    return std::min(
        1.0,
        tests_ *
            ProbabilityOf(difference, directions_.transpose() * block.basis));
  }

  Side ShownBy(std::span<const JoinedSegment> part) const {
    const ThetaInformation information =
        InformationOfAll(rig_, theta_, part, options_);
    Eigen::MatrixXd Lambda = directions_.transpose() * scale_.asDiagonal() *
                             information.Lambda(free_, free_) *
                             scale_.asDiagonal() * directions_;
    Lambda.diagonal().array() += 1;  // the prior's
    const Eigen::LLT<Eigen::MatrixXd> solver(Lambda);
    return {
        solver.solve(directions_.transpose() *
                     scale_.cwiseProduct(information.eta(free_))),
        solver.solve(Eigen::MatrixXd::Identity(Lambda.rows(), Lambda.cols()))};
  }

  Difference Compare(std::span<const JoinedSegment> all, int newer) const {
    const Side before = ShownBy(all.first(all.size() - newer));
    const Side after = ShownBy(all.last(newer));
    return {after.mean - before.mean,
            (excess_ * (after.covariance + before.covariance)).inverse()};
  }

  double WithoutOne(int newer, const ParameterBlock& block) const {
    double largest = 0;
    const auto count = static_cast<int>(segments_.size());
    for (int i = 0; i < count; ++i) {
      std::vector<JoinedSegment> rest = segments_;
      rest.erase(rest.begin() + i);
      const int left = i < count - newer ? newer : newer - 1;
      largest = std::max(largest, Probability(Compare(rest, left), block));
    }
    return largest;
  }

  std::vector<std::string> Concerned(const Difference& difference) const {
    const Eigen::MatrixXd by_free = directions_ * difference.information;
    return ConcernedNames(FindConcerned(
        GroupBlocks(rig_),
        {by_free * directions_.transpose(), by_free * difference.mean},
        kConcerned));
  }

  const Rig& rig_;
  const Calibration& theta_;
  const std::vector<int> free_;
  const Eigen::VectorXd scale_;       // prior sigmas of free components
  const Eigen::MatrixXd directions_;  // of free components
  const double excess_;
  const std::vector<JoinedSegment> segments_;
  const EvictedOptions& options_;
  const std::vector<ParameterBlock> blocks_;
  double tests_ = 1;
};

}  // namespace

DeviceSplit FindSplit(const Rig& rig,
                      const Calibration& theta,
                      const Eigen::MatrixXd& estimated,
                      double excess,
                      std::span<const JoinedSegment> segments,
                      const EvictedOptions& options) {
  return SplitSearch(rig, theta, estimated, excess, segments, options).Run();
}

}  // namespace selfcal
