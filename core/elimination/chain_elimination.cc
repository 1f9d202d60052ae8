#include "core/elimination/chain_elimination.h"

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
    mass_.resize(fixed);
  }
  front_.topLeftCorner(fixed, fixed).setZero();
  mass_.head(fixed).setZero();
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
    mass_.conservativeResize(capacity);
  }
  front_.block(old_size, 0, new_size - old_size, new_size).setZero();
  mass_.segment(old_size, new_size - old_size).setZero();
}

void ChainElimination::AddPrior(const ChainStateVector& information) {
  const auto add = [&](int at, const auto& diagonal) {
    front_.diagonal().segment(at, diagonal.size()) += diagonal;
    mass_.segment(at, diagonal.size()) += diagonal;
  };
  add(pose(0), information.head<kPose>());
  add(motion(), information.tail<kMotion>());
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
  mass_.segment<kPose>(pose) += rows.pose.colwise().squaredNorm();
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
  GuardedCholesky<3>(H.diagonal(), &H);
  for (const Run& run : runs_) {
    SolvePanel<3>(H,
                  landmark_panel_.middleRows(run.begin, run.end - run.begin));
  }
  SubtractLandmarkPanel();
}

void ChainElimination::Advance(const LinkRows& link) {
  OpenSlots(2);
  // In the order of the front, so that only the lower triangle is written.
  struct Part {
    int at;
    Eigen::Matrix<double, kState, Eigen::Dynamic> J;
  };
  const Part parts[] = {
      {link.shared_offset, link.shared},
      {rhs(), link.residual},
      {motion(), link.x0.rightCols<kMotion>()},
      {next_motion(), link.x1.rightCols<kMotion>()},
      {pose(0), link.x0.leftCols<kPose>()},
      {pose(1), link.x1.leftCols<kPose>()},
  };
  for (const Part& row : parts) {
    for (const Part& column : parts) {
      if (column.at > row.at) break;
      front_.block(row.at, column.at, row.J.cols(), column.J.cols()) +=
          row.J.transpose() * column.J;
    }
    mass_.segment(row.at, row.J.cols()) += row.J.colwise().squaredNorm();
  }
  EliminateCurrent();
  ++current_;
}

SharedInformation ChainElimination::Finish() {
  EliminateCurrent();
  SharedInformation result;
  result.Lambda = front_.topLeftCorner(shared_size_, shared_size_)
                      .selfadjointView<Eigen::Lower>();
  result.eta = -front_.row(rhs()).head(shared_size_).transpose();
  return result;
}

// Columns of the current keyframe against all that stays, with rows already in
// the places they have after CloseGap().
void ChainElimination::GatherPanel() {
  const int shared = shared_size_ + 1;
  const int after = size() - kPose;
  const int poses = after - pose(0);
  state_panel_.resize(std::max<int>(state_panel_.rows(), after),
                      Eigen::NoChange);
  auto at_motion = state_panel_.leftCols<kMotion>();
  auto at_pose = state_panel_.rightCols<kPose>();
  at_motion.topRows(shared) =
      front_.block(motion(), 0, kMotion, shared).transpose();
  at_pose.topRows(shared) = front_.block(pose(0), 0, kPose, shared).transpose();
  at_motion.middleRows<kMotion>(motion()) =
      front_.block<kMotion, kMotion>(next_motion(), motion());
  at_pose.middleRows<kMotion>(motion()) =
      front_.block<kPose, kMotion>(pose(0), next_motion()).transpose();
  state_panel_.middleRows<kMotion>(next_motion()).setZero();
  at_motion.middleRows(pose(0), poses) =
      front_.block(pose(1), motion(), poses, kMotion);
  at_pose.middleRows(pose(0), poses) =
      front_.block(pose(1), pose(0), poses, kPose);
}

// Takes the current keyframe out of the front: the next one's motion and poses
// move up, and the place of the motion after it is empty. Every entry moves up
// and left, so ascending order never overwrites what is still to be read.
void ChainElimination::CloseGap() {
  const int poses = (slots_ - 1) * kPose;
  const auto move_column = [&](int to, int from) {
    const auto move_rows = [&](int row_to, int row_from, int count) {
      const double* source = &front_.coeffRef(row_from, from);
      std::copy(source, source + count, &front_.coeffRef(row_to, to));
    };
    if (to < motion()) {
      move_rows(motion(), next_motion(), kMotion);
    } else if (to < next_motion()) {
      move_rows(to, from, next_motion() - to);
    }
    if (to < next_motion()) {
      front_.col(to).segment<kMotion>(next_motion()).setZero();
      move_rows(pose(0), pose(1), poses);
    } else {
      move_rows(to, from, pose(0) + poses - to);
    }
  };
  for (int c = 0; c < motion(); ++c) move_column(c, c);
  for (int c = motion(); c < next_motion(); ++c) move_column(c, c + kMotion);
  front_.block(next_motion(), next_motion(), kMotion + poses, kMotion)
      .setZero();
  for (int c = pose(0); c < pose(0) + poses; ++c) move_column(c, c + kPose);
  mass_.segment<kMotion>(motion()) =
      mass_.segment<kMotion>(next_motion()).eval();
  mass_.segment<kMotion>(next_motion()).setZero();
  mass_.segment(pose(0), poses) = mass_.segment(pose(1), poses).eval();
  --slots_;
}

void ChainElimination::EliminateCurrent() {
  ChainStateMatrix L;
  L.topLeftCorner<kMotion, kMotion>() =
      front_.block<kMotion, kMotion>(motion(), motion());
  L.bottomLeftCorner<kPose, kMotion>() =
      front_.block<kPose, kMotion>(pose(0), motion());
  L.bottomRightCorner<kPose, kPose>() =
      front_.block<kPose, kPose>(pose(0), pose(0));
  ChainStateVector mass;
  mass << mass_.segment<kMotion>(motion()), mass_.segment<kPose>(pose(0));
  GuardedCholesky<kState>(mass, &L);
  GatherPanel();
  CloseGap();
  auto panel = state_panel_.topRows(size());
  SolvePanel<kState>(L, panel);
  front_.topLeftCorner(size(), size())
      .selfadjointView<Eigen::Lower>()
      .rankUpdate(panel, -1.0);
}

}  // namespace selfcal
