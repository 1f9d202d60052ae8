#include "core/calibration/sparse_elimination.h"

#include <Eigen/Cholesky>

namespace selfcal {
namespace {

using Triplets = std::vector<Eigen::Triplet<double>>;

// Appends a block of the lower triangle; the upper half of a block on the
// diagonal is left out.
template <class Block>
void AppendLower(const Block& block, int row, int column, Triplets* triplets) {
  for (int i = 0; i < block.rows(); ++i) {
    for (int j = 0; j < block.cols(); ++j) {
      if (row + i >= column + j) {
        triplets->emplace_back(row + i, column + j, block(i, j));
      }
    }
  }
}

}  // namespace

void SparseElimination::Start(int keyframes, int shared_size) {
  keyframes_ = keyframes;
  shared_size_ = shared_size;
  landmarks_.clear();
  states_.clear();
  poses_.clear();
  for (int k = 0; k < keyframes; ++k) {
    states_[{k, k}].setZero();
  }
  keyframe_shared_.setZero(keyframes * kChainStateSize, shared_size + 1);
  shared_.setZero(shared_size + 1, shared_size + 1);
}

void SparseElimination::AddPrior(int keyframe,
                                 const ChainStateMatrix& information) {
  states_[{keyframe, keyframe}] += information;
}

void SparseElimination::AddLink(int before, int after, const LinkRows& rows) {
  states_[{before, before}] += rows.x0.transpose() * rows.x0;
  states_[{after, after}] += rows.x1.transpose() * rows.x1;
  const auto [link, created] =
      states_.try_emplace({before, after}, ChainStateMatrix::Zero());
  link->second += rows.x0.transpose() * rows.x1;

  const auto columns = static_cast<int>(rows.shared.cols());
  for (const int end : {before, after}) {
    const ChainStateMatrix& x = end == before ? rows.x0 : rows.x1;
    auto to =
        keyframe_shared_.middleRows<kChainStateSize>(end * kChainStateSize);
    to.middleCols(rows.shared_offset, columns) += x.transpose() * rows.shared;
    to.col(shared_size_) -= x.transpose() * rows.residual;
  }
  shared_.block(rows.shared_offset, rows.shared_offset, columns, columns) +=
      rows.shared.transpose() * rows.shared;
  shared_.row(shared_size_).segment(rows.shared_offset, columns) -=
      rows.residual.transpose() * rows.shared;
}

void SparseElimination::AddLandmark(std::span<const LandmarkRows> rows,
                                    double prior_information,
                                    double prior_residual) {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  auto& [L, by_shared, by_pose] = landmarks_.emplace_back();
  by_shared.setZero(shared_size_ + 1, 3);
  H(2, 2) = prior_information;
  by_shared(shared_size_, 2) = -prior_information * prior_residual;
  for (const LandmarkRows& row : rows) {
    const auto columns = static_cast<int>(row.shared.cols());
    H += row.landmark.transpose() * row.landmark;
    by_shared.middleRows(row.shared_offset, columns) +=
        row.shared.transpose() * row.landmark;
    by_shared.row(shared_size_) -= row.residual.transpose() * row.landmark;
    if (by_pose.empty() || by_pose.back().first != row.keyframe) {
      by_pose.emplace_back(row.keyframe, ByLandmark::Zero());
    }
    by_pose.back().second += row.pose.transpose() * row.landmark;

    poses_.try_emplace({row.keyframe, row.keyframe}, PoseBlock::Zero())
        .first->second += row.pose.transpose() * row.pose;
    auto to = keyframe_shared_.middleRows<kChainPoseSize>(row.keyframe *
                                                          kChainStateSize);
    to.middleCols(row.shared_offset, columns) +=
        row.pose.transpose() * row.shared;
    to.col(shared_size_) -= row.pose.transpose() * row.residual;
    shared_.block(row.shared_offset, row.shared_offset, columns, columns) +=
        row.shared.transpose() * row.shared;
    shared_.row(shared_size_).segment(row.shared_offset, columns) -=
        row.residual.transpose() * row.shared;
  }

  const Eigen::LLT<Eigen::Matrix3d> llt(H);
  L = llt.matrixL();
  const auto upper = llt.matrixU();
  // X <- X U^-1, so that X X^T is what the landmark takes with it.
  upper.solveInPlace<Eigen::OnTheRight>(by_shared);
  for (auto& [keyframe, block] : by_pose) {
    upper.solveInPlace<Eigen::OnTheRight>(block);
  }
  shared_.noalias() -= by_shared * by_shared.transpose();
  for (std::size_t i = 0; i < by_pose.size(); ++i) {
    const auto& [k, block] = by_pose[i];
    keyframe_shared_.middleRows<kChainPoseSize>(k * kChainStateSize)
        .noalias() -= block * by_shared.transpose();
    for (std::size_t j = i; j < by_pose.size(); ++j) {
      const auto& [l, other] = by_pose[j];
      poses_.try_emplace({k, l}, PoseBlock::Zero()).first->second.noalias() -=
          block * other.transpose();
    }
  }
}

std::optional<SharedInformation> SparseElimination::Eliminate() {
  Triplets triplets;
  for (const auto& [pair, block] : states_) {
    AppendLower(block.transpose(),
                pair.second * kChainStateSize,
                pair.first * kChainStateSize,
                &triplets);
  }
  for (const auto& [pair, block] : poses_) {
    AppendLower(block.transpose(),
                pair.second * kChainStateSize,
                pair.first * kChainStateSize,
                &triplets);
  }
  const int size = keyframes_ * kChainStateSize;
  Eigen::SparseMatrix<double> H(size, size);
  H.setFromTriplets(triplets.begin(), triplets.end());

  llt_.compute(H);
  if (llt_.info() != Eigen::Success) {
    return std::nullopt;
  }
  const Eigen::MatrixXd half =
      llt_.matrixL().solve(llt_.permutationP() * keyframe_shared_);
  shared_.triangularView<Eigen::Lower>() -= half.transpose() * half;
  if (!shared_.allFinite()) {
    return std::nullopt;
  }
  SharedInformation result;
  result.Lambda = shared_.topLeftCorner(shared_size_, shared_size_)
                      .selfadjointView<Eigen::Lower>();
  result.eta = shared_.row(shared_size_).head(shared_size_).transpose();
  return result;
}

std::vector<ChainStateVector> SparseElimination::KeyframeSteps(
    const Eigen::VectorXd& shared_step) const {
  const Eigen::VectorXd all =
      llt_.solve(keyframe_shared_.col(shared_size_) -
                 keyframe_shared_.leftCols(shared_size_) * shared_step);
  std::vector<ChainStateVector> steps(keyframes_);
  for (int k = 0; k < keyframes_; ++k) {
    steps[k] = all.segment<kChainStateSize>(k * kChainStateSize);
  }
  return steps;
}

std::vector<Eigen::Vector3d> SparseElimination::LandmarkSteps(
    const Eigen::VectorXd& shared_step,
    const std::vector<ChainStateVector>& keyframe_steps) const {
  std::vector<Eigen::Vector3d> steps;
  steps.reserve(landmarks_.size());
  for (const auto& [L, by_shared, by_pose] : landmarks_) {
    Eigen::Vector3d step =
        by_shared.row(shared_size_).transpose() -
        by_shared.topRows(shared_size_).transpose() * shared_step;
    for (const auto& [k, block] : by_pose) {
      step -= block.transpose() * keyframe_steps[k].head<kChainPoseSize>();
    }
    steps.push_back(L.transpose().triangularView<Eigen::Upper>().solve(step));
  }
  return steps;
}

}  // namespace selfcal
