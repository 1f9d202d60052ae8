#include "core/elimination/chain_elimination.h"

#include <Eigen/LU>
#include <algorithm>

#include "core/elimination/small_cholesky.h"

namespace selfcal {
namespace {

constexpr int kPose = kChainPoseSize;
constexpr int kMotion = kChainMotionSize;
constexpr int kState = kChainStateSize;

}  // namespace

void ChainElimination::Start(int shared_size) {
  shared_size_ = shared_size;
  current_ = 0;
  slots_ = 0;
  const int fixed = pose(0);
  if (front_.rows() < fixed) {
    front_.resize(fixed, fixed);
  }
  front_.topLeftCorner(fixed, fixed).setZero();
  OpenSlots(1);
}

void ChainElimination::OpenSlots(int slots) {
  if (slots <= slots_) return;
  const int old_size = size();
  slots_ = slots;
  const int new_size = size();
  if (front_.rows() < new_size) {
    const int capacity = std::max<int>(new_size, 2 * front_.rows());
    front_.conservativeResize(capacity, capacity);
  }
  front_.block(old_size, 0, new_size - old_size, new_size).setZero();
}

void ChainElimination::AddPrior(const ChainStateMatrix& information) {
  front_.block<kPose, kPose>(pose(0), pose(0)) +=
      information.topLeftCorner<kPose, kPose>();
  front_.block<kPose, kMotion>(pose(0), motion()) +=
      information.topRightCorner<kPose, kMotion>();
  front_.block<kMotion, kMotion>(motion(), motion()) +=
      information.bottomRightCorner<kMotion, kMotion>();
}

void ChainElimination::AddRun(int begin, int end) {
  if (!runs_.empty() && runs_.back().end == begin) {
    runs_.back().end = end;
  } else {
    runs_.push_back({begin, end});
  }
}

// The parts of the front that a landmark touches, ascending and disjoint.
void ChainElimination::FindRuns(std::span<const LandmarkRows> rows) {
  runs_.clear();
  for (const LandmarkRows& row : rows) {
    const int begin = row.shared_offset;
    const Run run{begin, begin + static_cast<int>(row.shared.cols())};
    const auto at = std::lower_bound(
        runs_.begin(), runs_.end(), run, [](const Run& a, const Run& b) {
          return a.begin < b.begin;
        });
    if (at == runs_.end() || at->begin != begin) runs_.insert(at, run);
  }
  AddRun(rhs(), rhs() + 1);
  int last = -1;
  for (const LandmarkRows& row : rows) {
    const int slot = row.keyframe - current_;
    if (slot != last) AddRun(pose(slot), pose(slot + 1));
    last = slot;
  }
}

void ChainElimination::AddToFront(const LandmarkRows& rows, int pose) {
  const auto& J = rows.shared;
  const auto& r = rows.residual;
  const int offset = rows.shared_offset;
  const int size = static_cast<int>(J.cols());
  const Eigen::Matrix<double, kPose, 2> pose_t = rows.pose.transpose();
  front_.block<kPose, kPose>(pose, pose) += pose_t * rows.pose;
  front_.block<kPose, 1>(pose, rhs()) += pose_t * r;
  for (int c = 0; c < size; ++c) {
    const Eigen::Vector2d column = J.col(c);
    double* front = &front_.coeffRef(offset, offset + c);
    for (int i = c; i < size; ++i) {
      front[i] += J(0, i) * column(0) + J(1, i) * column(1);
    }
    front_(rhs(), offset + c) += r.dot(column);
    front_.block<kPose, 1>(pose, offset + c) += pose_t * column;
  }
}

void ChainElimination::AddToPanel(const LandmarkRows& rows, int pose) {
  const auto& J = rows.shared;
  landmark_panel_.block<kPose, 3>(pose, 0) +=
      rows.pose.transpose() * rows.landmark;
  landmark_panel_.row(rhs()) += rows.residual.transpose() * rows.landmark;
  for (int c = 0; c < J.cols(); ++c) {
    landmark_panel_.row(rows.shared_offset + c) +=
        J.col(c).transpose() * rows.landmark;
  }
}

// front -= panel panel^T on the touched parts of the lower triangle.
void ChainElimination::SubtractLandmarkPanel() {
  for (auto columns = runs_.begin(); columns != runs_.end(); ++columns) {
    for (int c = columns->begin; c < columns->end; ++c) {
      const Eigen::Vector3d w = landmark_panel_.row(c);
      for (auto rows = columns; rows != runs_.end(); ++rows) {
        const int begin = std::max(c, rows->begin);
        const int count = rows->end - begin;
        front_.col(c).segment(begin, count) -=
            w(0) * landmark_panel_.col(0).segment(begin, count) +
            w(1) * landmark_panel_.col(1).segment(begin, count) +
            w(2) * landmark_panel_.col(2).segment(begin, count);
      }
    }
  }
}

void ChainElimination::AddLandmark(std::span<const LandmarkRows> rows,
                                   double prior_information) {
  OpenSlots(rows.back().keyframe - current_ + 1);
  FindRuns(rows);
  if (landmark_panel_.rows() < front_.rows()) {
    landmark_panel_.resize(front_.rows(), 3);
  }
  for (const Run& run : runs_) {
    landmark_panel_.middleRows(run.begin, run.end - run.begin).setZero();
  }
  Eigen::Matrix3d H = prior_information * Eigen::Matrix3d::Identity();
  for (const LandmarkRows& row : rows) {
    const int at = pose(row.keyframe - current_);
    AddToFront(row, at);
    AddToPanel(row, at);
    H += row.landmark.transpose() * row.landmark;
  }
  GuardedCholesky<3>(&H);
  for (const Run& run : runs_) {
    SolvePanel<3>(H,
                  landmark_panel_.middleRows(run.begin, run.end - run.begin));
  }
  SubtractLandmarkPanel();
}

// Takes the current state out of the front: returns its information, leaves its
// coupling with what stays in coupling_, in the places after CloseGap().
ChainStateMatrix ChainElimination::TakeCurrent() {
  ChainStateMatrix current;
  current.topLeftCorner<kPose, kPose>() =
      front_.block<kPose, kPose>(pose(0), pose(0))
          .selfadjointView<Eigen::Lower>();
  current.bottomRightCorner<kMotion, kMotion>() =
      front_.block<kMotion, kMotion>(motion(), motion())
          .selfadjointView<Eigen::Lower>();
  current.topRightCorner<kPose, kMotion>() =
      front_.block<kPose, kMotion>(pose(0), motion());
  current.bottomLeftCorner<kMotion, kPose>() =
      current.topRightCorner<kPose, kMotion>().transpose();

  const int shared = shared_size_ + 1;
  const int poses = (slots_ - 1) * kPose;
  if (coupling_.rows() < front_.rows()) {
    coupling_.resize(front_.rows(), Eigen::NoChange);
    solution_.resize(front_.rows(), Eigen::NoChange);
    product_.resize(front_.rows(), Eigen::NoChange);
  }
  auto of_pose = coupling_.leftCols<kPose>();
  auto of_motion = coupling_.rightCols<kMotion>();
  of_pose.topRows(shared) = front_.block(pose(0), 0, kPose, shared).transpose();
  of_motion.topRows(shared) =
      front_.block(motion(), 0, kMotion, shared).transpose();
  coupling_.middleRows<kMotion>(motion()).setZero();
  of_pose.middleRows(pose(0), poses) =
      front_.block(pose(1), pose(0), poses, kPose);
  of_motion.middleRows(pose(0), poses) =
      front_.block(pose(1), motion(), poses, kMotion);
  CloseGap();
  return current;
}

// Moves the poses up by one and clears the place of the motion. Every entry
// moves up and left, so ascending order never overwrites what is still to be
// read.
void ChainElimination::CloseGap() {
  const int poses = (slots_ - 1) * kPose;
  const auto move_column = [&](int to, int from, int row) {
    const double* source = &front_.coeffRef(row + kPose, from);
    std::copy(
        source, source + (pose(0) + poses - row), &front_.coeffRef(row, to));
  };
  for (int c = 0; c < motion(); ++c) {
    front_.col(c).segment<kMotion>(motion()).setZero();
    move_column(c, c, pose(0));
  }
  front_.block(motion(), motion(), kMotion + poses, kMotion).setZero();
  for (int c = pose(0); c < pose(0) + poses; ++c) {
    move_column(c, c + kPose, c);
  }
  --slots_;
}

// Solves the link for the current state,
//   x0 = A e + G^T (shared, 1, motion and pose of the next),
// with its noise e of unit information, and puts that into the quadratic form
//   x0^T S x0 + 2 x0^T Y^T z
// where S is `current` and Y coupling_. Leaves G in solution_ and the coupling
// of x0 with z in coupling_; returns A.
ChainStateMatrix ChainElimination::Substitute(const LinkRows& link,
                                              const ChainStateMatrix& current) {
  const int shared = static_cast<int>(link.shared.cols());
  // Rows of different kinds differ by many orders: equilibrated before LU.
  const ChainStateVector scale =
      link.x0.rowwise().lpNorm<Eigen::Infinity>().cwiseInverse();
  const Eigen::PartialPivLU<ChainStateMatrix> lu(scale.asDiagonal() * link.x0);
  const auto solve = [&](const auto& rows) {
    return lu.solve(scale.asDiagonal() * rows).eval();
  };
  const int fixed = pose(1);
  auto G = solution_.topRows(fixed);
  G.setZero();
  G.middleRows(link.shared_offset, shared) = -solve(link.shared).transpose();
  G.row(rhs()) = -solve(link.residual).transpose();
  const ChainStateMatrix next = -solve(link.x1).transpose();
  G.middleRows<kMotion>(motion()) = next.bottomRows<kMotion>();
  G.middleRows<kPose>(pose(0)) = next.topRows<kPose>();

  // G S G^T + G Y^T + Y G^T = G H^T + H G^T with H = Y + G S / 2, below the
  // diagonal; G has rows in the first `fixed` places only.
  const auto half = (0.5 * (G * current)).eval();
  coupling_.topRows(fixed) += half;
  const auto H = coupling_.topRows(fixed);
  auto top = front_.topLeftCorner(fixed, fixed);
  top.triangularView<Eigen::Lower>() += G * H.transpose();
  top.triangularView<Eigen::Lower>() += H * G.transpose();
  const int rest = size() - fixed;
  const auto add_below = [&](int begin, int columns) {
    front_.block(fixed, begin, rest, columns).noalias() +=
        coupling_.middleRows(fixed, rest) *
        solution_.middleRows(begin, columns).transpose();
  };
  add_below(link.shared_offset, shared);
  add_below(rhs(), fixed - rhs());
  coupling_.topRows(fixed) += half;
  return solve(ChainStateMatrix::Identity());
}

// front -= product product^T on the lower triangle.
void ChainElimination::SubtractStatePanel() {
  front_.topLeftCorner(size(), size())
      .selfadjointView<Eigen::Lower>()
      .rankUpdate(product_.topRows(size()), -1.0);
}

void ChainElimination::Advance(const LinkRows& link) {
  OpenSlots(2);
  const ChainStateMatrix current = TakeCurrent();
  const ChainStateMatrix A = Substitute(link, current);
  ChainStateMatrix L =
      ChainStateMatrix::Identity() + A.transpose() * current * A;
  GuardedCholesky<kState>(&L);
  // L^-1 A^T, transposed.
  const ChainStateMatrix root =
      L.triangularView<Eigen::Lower>().solve(A.transpose()).transpose();
  product_.topRows(size()).noalias() = coupling_.topRows(size()) * root;
  SubtractStatePanel();
  ++current_;
}

SharedInformation ChainElimination::Finish() {
  ChainStateMatrix L = TakeCurrent();
  GuardedCholesky<kState>(&L);
  auto panel = product_.topRows(size());
  panel = coupling_.topRows(size());
  SolvePanel<kState>(L, panel);
  SubtractStatePanel();
  SharedInformation result;
  result.Lambda = front_.topLeftCorner(shared_size_, shared_size_)
                      .selfadjointView<Eigen::Lower>();
  result.eta = -front_.row(rhs()).head(shared_size_).transpose();
  return result;
}

}  // namespace selfcal
