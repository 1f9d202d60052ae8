// Landmarks of a chain: from the rows of their factors to their elimination.
#include <algorithm>

#include "core/elimination/chain_elimination.h"
#include "core/elimination/chain_places.h"
#include "core/elimination/landmark_rows.h"
#include "core/elimination/small_cholesky.h"

namespace selfcal {

using namespace chain;

void ChainElimination::FindViews(const ChainShape& shape) {
  landmarks_count_ = shape.tracks.size() - 1;
  const std::size_t landmarks = landmarks_count_;
  kept_landmarks_.assign(landmarks, kEliminated);
  std::copy(shape.kept_landmarks.begin(),
            shape.kept_landmarks.end(),
            kept_landmarks_.begin());
  GrowTo(6 * landmarks, &roots_);
  sums_.assign(landmarks * sums_size_, 0);
  landmark_priors_.assign(landmarks * 9, 0);
  GrowTo(shape.track_keyframes.size(), &landmark_of_observation_);
  GrowTo(shape.track_keyframes.size(), &view_of_observation_);
  views_.clear();
  views_begin_.assign(1, 0);
  for (std::size_t m = 0; m < landmarks; ++m) {
    for (int o = shape.tracks[m]; o < shape.tracks[m + 1]; ++o) {
      landmark_of_observation_[o] = static_cast<int>(m);
      const int keyframe = shape.track_keyframes[o];
      if (o == shape.tracks[m] || views_.back().keyframe != keyframe) {
        views_.push_back({keyframe, structure_.Slot(o)});
      }
      view_of_observation_[o] = static_cast<int>(views_.size()) - 1;
    }
    views_begin_.push_back(static_cast<int>(views_.size()));
  }
  pose_rows_.assign(views_.size() * 3 * kPose, 0);
}

// Number of doubles in a row over the poses that observe a landmark.
int ChainElimination::PosesOf(int landmark) const {
  return (views_begin_[landmark + 1] - views_begin_[landmark]) * kPose;
}

double* ChainElimination::PoseRow(int landmark, int row) {
  return &pose_rows_[static_cast<std::size_t>(views_begin_[landmark]) * 3 *
                     kPose] +
         row * PosesOf(landmark);
}

// Adds the products of all columns of a run, in gram_, to those of the keyframe
// and the camera that they represent.
void ChainElimination::ExpandGram(int keyframe,
                                  int camera,
                                  const PoseRotation* by_rotation) {
  const int size = camera_sizes_[camera];
  const int offset = camera_offsets_[camera];
  const int residual = RowsResidual(size);
  const int stride = RowsStride(size) + kPanelPad;
  const auto gram = [&](int i, int j) {
    return i >= j ? gram_[j * stride + i] : gram_[i * stride + j];
  };
  // by_pose(i, c): pose i and column c; poses(i, j): two of the pose.
  const auto add_pose = [&](const auto& by_pose, const auto& poses) {
    for (int i = 0; i < kPose; ++i) {
      double* row = &keyframe_sums_[(keyframe * kPose + i) * keyframe_stride_];
      for (int j = 0; j <= i; ++j) row[j] += poses(i, j);
      double* shared = row + kPose + offset;
      for (int c = 0; c < 3; ++c) shared[c] -= by_pose(i, kRowsTurn + c);
      for (int c = 3; c < size; ++c) shared[c] += by_pose(i, kRowsOwn + c - 3);
      row[kPose + landmark_shared_] += by_pose(i, residual);
    }
  };
  if (by_rotation == nullptr) {
    add_pose(gram, gram);
  } else {
    Eigen::Matrix<double, kPose, kPose> turn;
    turn.setIdentity();
    turn.leftCols<3>() = *by_rotation;
    const auto by_pose = [&](int i, int c) {
      double sum = 0;
      for (int n = 0; n < kPose; ++n) sum += turn(n, i) * gram(n, c);
      return sum;
    };
    add_pose(by_pose, [&](int i, int j) {
      double sum = 0;
      for (int n = 0; n < kPose; ++n) sum += by_pose(i, n) * turn(n, j);
      return sum;
    });
  }
  const int rows = landmark_shared_ + 1;
  const auto column = [](int c) {
    return c < 3 ? kRowsTurn + c : kRowsOwn + c - 3;
  };
  for (int j = 0; j < size; ++j) {
    double* to = &shared_sums_[(offset + j) * rows];
    for (int i = j; i < size; ++i) {
      const double product = gram(column(i), column(j));
      to[offset + i] += (i < 3) == (j < 3) ? product : -product;
    }
    const double product = gram(residual, column(j));
    to[landmark_shared_] += j < 3 ? -product : product;
  }
}

void ChainElimination::AddObservations(int keyframe,
                                       int camera,
                                       const double* rows,
                                       std::span<const int> observations,
                                       const PoseRotation* by_rotation) {
  const int size = camera_sizes_[camera];
  const int stride = RowsStride(size);
  const int gram_stride = stride + kPanelPad;
  const int count = static_cast<int>(observations.size());
  GrowTo(observations.size(), &targets_);
  for (int i = 0; i < count; ++i) {
    const int o = observations[i];
    const int m = landmark_of_observation_[o];
    const int view = view_of_observation_[o] - views_begin_[m];
    targets_[i] = {&sums_[m * sums_size_ + sums_offsets_[camera]],
                   PoseRow(m, 0) + view * kPose,
                   PosesOf(m)};
  }
  if (by_rotation != nullptr) CollectPoses(count);
  Zero(gram_.data(), static_cast<std::size_t>(gram_stride) * stride);
  WithKernels([&](auto kernels) {
    kernels.AddLandmarkProducts(rows, stride, count, targets_.data());
    kernels.AddSquare(1,
                      {rows, stride},
                      RowsResidual(size) + 1,
                      2 * count,
                      {gram_.data(), gram_stride});
  });
  if (by_rotation != nullptr) SpreadPoses(count, *by_rotation);
  ExpandGram(keyframe, camera, by_rotation);
}

// Redirects the products with the pose of each factor to a separate panel,
// until they have been rotated.
void ChainElimination::CollectPoses(int count) {
  GrowTo(static_cast<std::size_t>(count), &panels_of_poses_);
  own_poses_.assign(static_cast<std::size_t>(count) * 3 * kOwnPoseStride, 0);
  for (int i = 0; i < count; ++i) {
    panels_of_poses_[i] = {targets_[i].poses, targets_[i].pose_stride};
    targets_[i].poses = &own_poses_[i * 3 * kOwnPoseStride];
    targets_[i].pose_stride = kOwnPoseStride;
  }
}

void ChainElimination::SpreadPoses(int count, const PoseRotation& by_rotation) {
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < 3; ++j) {
      const double* from = targets_[i].poses + j * kOwnPoseStride;
      double* to = panels_of_poses_[i].data + j * panels_of_poses_[i].stride;
      Eigen::Map<Eigen::RowVector3d>(to + kRowsTurn) +=
          Eigen::Map<const Eigen::Matrix<double, 1, kPose>>(from) * by_rotation;
      for (int c = kRowsPosition; c < kRowsOwn; ++c) to[c] += from[c];
    }
  }
}

void ChainElimination::AddLandmarkPrior(int landmark,
                                        const Eigen::Matrix3d& H,
                                        const Eigen::Vector3d& g) {
  double* prior = &landmark_priors_[9 * landmark];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j <= i; ++j) prior[i * (i + 1) / 2 + j] += H(i, j);
    prior[6 + i] += g(i);
  }
}

// Fills the panel of a landmark, with rows `stride` apart, from its sums and
// its rows over poses. Returns its information.
Eigen::Matrix3d ChainElimination::PreparePanel(int landmark,
                                               double* panel,
                                               int stride) {
  const double* prior = &landmark_priors_[9 * landmark];
  const int shared_places = fixed_ - landmark_place_;
  Eigen::Matrix3d H;
  for (int j = 0; j < 3; ++j) {
    double* row = panel + j * stride;
    Zero(row, stride);
    const double* by_pose = PoseRow(landmark, j);
    for (int v = views_begin_[landmark]; v < views_begin_[landmark + 1]; ++v) {
      std::copy_n(by_pose, kPose, row + shared_places + views_[v].slot * kPose);
      by_pose += kPose;
    }
    for (int i = 0; i <= j; ++i) H(j, i) = prior[j * (j + 1) / 2 + i];
    row[landmark_shared_] = prior[6 + j];
    for (std::size_t c = 0; c < camera_sizes_.size(); ++c) {
      const int size = camera_sizes_[c];
      const double* sums = &sums_[landmark * sums_size_ + sums_offsets_[c] +
                                  j * RowsStride(size)];
      double* shared = row + camera_offsets_[c];
      for (int i = 0; i < 3; ++i) shared[i] = -sums[kRowsTurn + i];
      for (int i = 3; i < size; ++i) shared[i] = sums[kRowsOwn + i - 3];
      row[landmark_shared_] += sums[RowsResidual(size)];
      for (int i = 0; i <= j; ++i) H(j, i) -= sums[kRowsPosition + i];
    }
  }
  H.triangularView<Eigen::StrictlyUpper>() = H.transpose();
  return H;
}

// The inverse of PreparePanel, for the back-substitution.
void ChainElimination::RecordPanel(int landmark,
                                   const double* panel,
                                   int stride) {
  double* shared = &sums_[landmark * sums_size_];
  for (int j = 0; j < 3; ++j) {
    const double* row = panel + j * stride;
    shared = std::copy_n(row, landmark_shared_ + 1, shared);
    row += fixed_ - landmark_place_;
    double* by_pose = PoseRow(landmark, j);
    for (int v = views_begin_[landmark]; v < views_begin_[landmark + 1]; ++v) {
      by_pose = std::copy_n(row + views_[v].slot * kPose, kPose, by_pose);
    }
  }
}

void ChainElimination::SetRoot(int landmark, Eigen::Matrix3d information) {
  Eigen::Matrix3d& L = information;
  GuardedCholesky<3>(&L);
  double* root = &roots_[6 * landmark];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < i; ++j) root[i * (i + 1) / 2 + j] = L(i, j);
    root[i * (i + 1) / 2 + i] = 1 / L(i, i);
  }
}

// Adds a kept landmark to the front, instead of eliminating it; its panel
// eliminates nothing.
void ChainElimination::KeepLandmark(int landmark,
                                    const Eigen::Matrix3d& information,
                                    double* panel,
                                    int stride) {
  const int place = kKeptPlace + kept_landmarks_[landmark];
  const int shared = fixed_ - landmark_place_;
  const int poses = structure_.Slots(landmark) * kPose;
  for (int j = 0; j < 3; ++j) {
    double* row = panel + j * stride;
    for (int i = j; i < 3; ++i) {
      Front(place + i, place + j) += information(i, j);
    }
    for (int c = 0; c <= landmark_shared_; ++c) {
      Front(landmark_place_ + c, place + j) += row[c];
    }
    for (int i = 0; i < poses; ++i) {
      Front(Pose(0) + i, place + j) += row[shared + i];
    }
    Zero(row, shared + poses);
  }
  SetRoot(landmark, Eigen::Matrix3d::Identity());
}

void ChainElimination::EliminateLandmarks() {
  const std::span<const int> group = structure_.Landmarks(current_);
  if (group.empty()) return;
  const int shared = fixed_ - landmark_place_;
  const int slots = structure_.Slots(group.front());
  const int stride = shared + WholeVectors(slots * kPose) + kZeros;
  const int depth = 3 * static_cast<int>(group.size());
  GrowTo(static_cast<std::size_t>(depth) * stride, &group_panels_);
  depths_.assign(slots, 0);
  for (const int m : group) depths_[structure_.Slots(m) - 1] += 3;
  for (int s = slots - 1; s > 0; --s) depths_[s - 1] += depths_[s];
  const auto panel_of = [&](std::size_t place) {
    return &group_panels_[place * 3 * stride];
  };
  for (std::size_t i = 0; i < group.size(); ++i) {
    const int m = group[i];
    const Eigen::Matrix3d information = PreparePanel(m, panel_of(i), stride);
    if (kept_landmarks_[m] == kEliminated) {
      SetRoot(m, information);
    } else {
      KeepLandmark(m, information, panel_of(i), stride);
    }
  }
  const ConstPanel by_shared = {group_panels_.data(), stride};
  const ConstPanel by_pose = {group_panels_.data() + shared, stride};
  WithKernels([&](auto kernels) {
    for (std::size_t i = 0; i < group.size(); ++i) {
      kernels.SolveThreeRows(&roots_[6 * group[i]],
                             panel_of(i),
                             stride,
                             shared + structure_.Slots(group[i]) * kPose);
    }
    kernels.AddSquare(-1,
                      by_shared,
                      shared,
                      depth,
                      FrontAt(landmark_place_, landmark_place_));
    const Depth stairs(depths_.data(), kPose);
    kernels.AddProduct(-1,
                       by_pose,
                       slots * kPose,
                       by_shared,
                       landmark_shared_ + 1,
                       stairs,
                       FrontAt(Pose(0), landmark_place_));
    kernels.AddSquare(
        -1, by_pose, slots * kPose, stairs, FrontAt(Pose(0), Pose(0)));
  });
  if (record_ == Record::kNothing) return;
  for (std::size_t i = 0; i < group.size(); ++i) {
    RecordPanel(group[i], panel_of(i), stride);
  }
}

}  // namespace selfcal
