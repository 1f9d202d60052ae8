#include "core/change/course.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <utility>
#include <vector>

#include "core/change/chi_square.h"
#include "core/model/symmetric_eigen.h"

namespace selfcal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Computes (Sigma^-1 + L0)^-1 without the inverse of either.
MatrixXd ErrorCovariance(const MatrixXd& L0, const MatrixXd& root) {
  MatrixXd A = root.transpose() * L0 * root;
  A.diagonal().array() += 1;
  return root * A.llt().solve(root.transpose());
}

bool SamePlace(const VectorXd& a, const VectorXd& b) {
  return a.size() == b.size() && a == b;
}

}  // namespace

void Course::Add(const OffsetInformation& segment, double weight) {
  auto at = std::find_if(sums_.begin(), sums_.end(), [&](const Sums& sums) {
    return SamePlace(sums.reach, segment.reach);
  });
  if (at == sums_.end()) {
    const Eigen::Index size = segment.eta.size();
    const MatrixXd none = MatrixXd::Zero(size, size);
    const VectorXd zero = VectorXd::Zero(size);
    sums_.push_back({segment.reach, none, none, none, zero, zero});
    at = sums_.end() - 1;
  }
  at->L0 += segment.Lambda;
  at->h0 += segment.eta;
  if (weight == 0) return;
  at->L1 += weight * segment.Lambda;
  at->L2 += weight * weight * segment.Lambda;
  at->h1 += weight * segment.eta;
}

void Course::Remove(const OffsetInformation& segment, double weight) {
  const auto at =
      std::find_if(sums_.begin(), sums_.end(), [&](const Sums& sums) {
        return SamePlace(sums.reach, segment.reach);
      });
  at->L0 -= segment.Lambda;
  at->h0 -= segment.eta;
  if (weight == 0) return;
  at->L1 -= weight * segment.Lambda;
  at->L2 -= weight * weight * segment.Lambda;
  at->h1 -= weight * segment.eta;
}

// Eliminates both errors of the reach, stacked like (e, x): their contribution
// to the segments consists of the same sums.
void Course::EliminateReach(Sums* sums) {
  const Eigen::Index size = sums->h0.size();
  MatrixXd M(2 * size, 2 * size);
  M << sums->L0, sums->L1, sums->L1.transpose(), sums->L2;
  VectorXd h(2 * size);
  h << sums->h0, sums->h1;
  VectorXd sigmas(2 * size);
  sigmas << sums->reach, sums->reach;
  const MatrixXd gain = M * ErrorCovariance(M, sigmas.asDiagonal());
  M -= (gain * M).eval();
  h -= gain * VectorXd(h);
  sums->L0 = M.topLeftCorner(size, size);
  sums->L1 = M.topRightCorner(size, size);
  sums->L2 = M.bottomRightCorner(size, size);
  sums->h0 = h.head(size);
  sums->h1 = h.tail(size);
}

Course::Sums Course::Total() const {
  Sums total;
  for (const Sums& sums : sums_) {
    Sums part = sums;
    if (sums.reach.size() > 0) EliminateReach(&part);
    if (total.L0.size() == 0) {
      total = std::move(part);
      continue;
    }
    total.L0 += part.L0;
    total.L1 += part.L1;
    total.L2 += part.L2;
    total.h0 += part.h0;
    total.h1 += part.h1;
  }
  return total;
}

OffsetInformation Course::Change() const {
  const Sums total = Total();
  const MatrixXd gain =
      total.L1.transpose() * ErrorCovariance(total.L0, *root_);
  return {total.L2 - gain * total.L1, total.h1 - gain * total.h0};
}

VectorXd Course::Offset(const VectorXd& x, double weight) const {
  const Sums total = Total();
  return ErrorCovariance(total.L0, *root_) * (total.h0 - total.L1 * x) +
         weight * x;
}

MatrixXd Course::OffsetByChange(double weight) const {
  const Sums total = Total();
  MatrixXd by_change = -ErrorCovariance(total.L0, *root_) * total.L1;
  by_change.diagonal().array() += weight;
  return by_change;
}

ConsistencyTest TestSpan(const OffsetInformation& change, const MatrixXd& B) {
  const MatrixXd L = B.transpose() * change.Lambda * B;
  const VectorXd s = B.transpose() * change.eta;
  ConsistencyTest test;
  const MatrixXd beyond_prior =
      L - kObserved * MatrixXd::Identity(L.rows(), L.cols());
  if (beyond_prior.llt().info() == Eigen::Success) {  // all are observed
    test.statistic = s.dot(L.llt().solve(s));
    test.degrees = static_cast<int>(s.size());
  } else {
    const SymmetricEigen eigen(L);
    for (Eigen::Index k = 0; k < s.size(); ++k) {
      const double information = eigen.eigenvalues()(k);
      if (information < kObserved) continue;
      const double along = eigen.eigenvectors().col(k).dot(s);
      test.statistic += along * along / information;
      ++test.degrees;
    }
  }
  if (test.degrees > 0) {
    test.probability = ChiSquareTail(test.statistic, test.degrees);
  }
  return test;
}

VectorXd StepCourse(int count, int newest) {
  VectorXd weights = VectorXd::Zero(count);
  weights.tail(newest).setOnes();
  return weights;
}

VectorXd RampCourse(int count, int newest) {
  VectorXd weights = VectorXd::Zero(count);
  weights.tail(newest).setLinSpaced(newest, 1.0 / newest, 1);
  return weights;
}

Course MakeCourse(std::span<const OffsetInformation> segments,
                  const VectorXd& weights,
                  const MatrixXd& root) {
  Course course(root);
  for (std::size_t i = 0; i < segments.size(); ++i) {
    course.Add(segments[i], weights(static_cast<Eigen::Index>(i)));
  }
  return course;
}

}  // namespace selfcal
