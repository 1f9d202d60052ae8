#include "core/elimination/chain_elimination.h"

#include <algorithm>
#include <cassert>
#include <cstring>

#include "core/elimination/landmark_rows.h"
#include "core/elimination/small_cholesky.h"

namespace selfcal {
namespace {

constexpr int kPose = kChainPoseSize;
constexpr int kMotion = kChainMotionSize;
constexpr int kState = kChainStateSize;
// Places in the front.
constexpr int kMotionPlace = kChainLinkShared;
constexpr int kKeptPlace = kMotionPlace + kMotion;
static_assert(kKeptPlace % 8 == 0);
static_assert(kTransitionConstant == kKeptPlace);
constexpr int kEliminated = -1;
// The state in whole tiles.
constexpr int kTileState = 16;
constexpr int kLinkColumns = kTransitionNextPose + kPose;
// Zeros that must follow what counts in a panel: the rows of the largest tile.
constexpr int kZeros = 3 * kPanelPad;

constexpr int kPlacesBetweenMoves = 8;

int WholeVectors(int size) { return (size + 7) / 8 * 8; }

template <typename Number>
void GrowTo(std::size_t size, std::vector<Number>* buffer) {
  if (buffer->size() < size) buffer->resize(size);
}

void Zero(double* begin, std::size_t size) {
  std::memset(begin, 0, size * sizeof(double));
}

}  // namespace

void ChainElimination::LayOut(const ChainShape& shape) {
  camera_sizes_.assign(shape.camera_sizes.begin(), shape.camera_sizes.end());
  camera_offsets_.clear();
  sums_offsets_.clear();
  landmark_shared_ = 0;
  sums_size_ = 0;
  int largest_row = 0;
  for (const int size : camera_sizes_) {
    camera_offsets_.push_back(landmark_shared_);
    landmark_shared_ += size;
    sums_offsets_.push_back(sums_size_);
    sums_size_ += 3 * RowsStride(size);
    largest_row = std::max(largest_row, RowsStride(size));
  }
  kept_ = shape.kept;
  landmark_place_ = kKeptPlace + WholeVectors(kept_);
  constant_ = landmark_place_ + landmark_shared_;
  fixed_ = WholeVectors(constant_ + 1);
  GrowTo(static_cast<std::size_t>(largest_row) * (largest_row + kPanelPad),
         &gram_);

  const int slots = structure_.max_slots();
  // The front moves on by a place with each keyframe, and back where it ends.
  places_ = std::max(
      places_,
      std::min(shape.keyframes, slots + slots / 4 + kPlacesBetweenMoves));
  front_stride_ = fixed_ + places_ * kPose + kZeros;
  GrowTo(static_cast<std::size_t>(front_stride_) *
             (fixed_ + places_ * kPose + kPanelPad),
         &front_);
  // Only what is fixed: poses are cleared as they enter.
  for (int j = 0; j < fixed_; ++j) Zero(&Front(0, j), fixed_ + kPanelPad);
  panel_stride_ = fixed_ + WholeVectors(slots * kPose) + kZeros;
  for (auto* panel : {&coupling_, &substituted_, &product_, &half_}) {
    GrowTo(static_cast<std::size_t>(kTileState) * panel_stride_, panel);
  }
  GrowTo(static_cast<std::size_t>(fixed_ + kPose + kPanelPad) * kLinkColumns,
         &link_terms_);

  keyframe_stride_ = kPose + landmark_shared_ + 1;
  const std::size_t sums =
      static_cast<std::size_t>(shape.keyframes) * kPose * keyframe_stride_;
  keyframe_sums_.assign(sums, 0);
  shared_sums_.assign((landmark_shared_ + 1) * (landmark_shared_ + 1), 0);
}

void ChainElimination::PlacePanels(const ChainShape& shape) {
  landmarks_count_ = shape.tracks.size() - 1;
  const std::size_t landmarks = landmarks_count_;
  kept_landmarks_.assign(landmarks, kEliminated);
  std::copy(shape.kept_landmarks.begin(),
            shape.kept_landmarks.end(),
            kept_landmarks_.begin());
  GrowTo(landmarks, &panel_of_landmark_);
  GrowTo(6 * landmarks, &roots_);
  sums_.assign(landmarks * sums_size_, 0);
  landmark_priors_.assign(landmarks * 9, 0);
  GrowTo(shape.track_keyframes.size(), &landmark_of_observation_);
  for (std::size_t m = 0; m < landmarks; ++m) {
    std::fill(landmark_of_observation_.begin() + shape.tracks[m],
              landmark_of_observation_.begin() + shape.tracks[m + 1],
              static_cast<int>(m));
  }
  const int shared = fixed_ - landmark_place_;
  std::size_t end = 0;
  for (int k = 0; k < shape.keyframes; ++k) {
    const std::span<const int> group = structure_.Landmarks(k);
    if (group.empty()) continue;
    const int longest = structure_.Slots(group.front()) * kPose;
    const int stride = shared + WholeVectors(longest) + kZeros;
    for (const int m : group) {
      panel_of_landmark_[m] = {end, stride};
      end += static_cast<std::size_t>(3) * stride;
    }
  }
  GrowTo(end, &panels_);
  for (std::size_t m = 0; m < landmarks; ++m) {
    const Panel& panel = panel_of_landmark_[m];
    const int poses = structure_.Slots(static_cast<int>(m)) * kPose + kZeros;
    for (int j = 0; j < 3; ++j) {
      Zero(&panels_[panel.begin + j * panel.stride + shared], poses);
    }
  }
}

void ChainElimination::Start(const ChainShape& shape, Record record) {
  structure_.Find(shape.keyframes, shape.tracks, shape.track_keyframes);
  LayOut(shape);
  PlacePanels(shape);
  record_ = record;
  steps_.clear();
  products_.clear();
  first_place_ = 0;
  slots_ = 0;
  current_ = 0;
  begun_ = false;
}

// Adds the products of all columns of a run, which are in gram_, to those of
// the keyframe and of the camera that they stand for.
void ChainElimination::ExpandGram(int keyframe, int camera) {
  const int size = camera_sizes_[camera];
  const int offset = camera_offsets_[camera];
  const int residual = RowsResidual(size);
  const int stride = RowsStride(size) + kPanelPad;
  const auto gram = [&](int i, int j) {
    return i >= j ? gram_[j * stride + i] : gram_[i * stride + j];
  };
  for (int i = 0; i < kPose; ++i) {
    double* row = &keyframe_sums_[(keyframe * kPose + i) * keyframe_stride_];
    for (int j = 0; j <= i; ++j) row[j] += gram(i, j);
    double* shared = row + kPose + offset;
    for (int c = 0; c < 3; ++c) shared[c] -= gram(i, kRowsTurn + c);
    for (int c = 3; c < size; ++c) shared[c] += gram(kRowsOwn + c - 3, i);
    row[kPose + landmark_shared_] += gram(residual, i);
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
                                       std::span<const int> observations) {
  const int size = camera_sizes_[camera];
  const int stride = RowsStride(size);
  const int gram_stride = stride + kPanelPad;
  const int count = static_cast<int>(observations.size());
  GrowTo(observations.size(), &targets_);
  const int shared = fixed_ - landmark_place_;
  for (int i = 0; i < count; ++i) {
    const int o = observations[i];
    const int m = landmark_of_observation_[o];
    const Panel& panel = panel_of_landmark_[m];
    targets_[i] = {&sums_[m * sums_size_ + sums_offsets_[camera]],
                   &panels_[panel.begin + shared + structure_.Slot(o) * kPose],
                   panel.stride};
  }
  Zero(gram_.data(), static_cast<std::size_t>(gram_stride) * stride);
  WithKernels([&](auto kernels) {
    kernels.AddLandmarkProducts(rows, stride, count, targets_.data());
    kernels.AddSquare(1,
                      {rows, stride},
                      RowsResidual(size) + 1,
                      2 * count,
                      nullptr,
                      1,
                      {gram_.data(), gram_stride});
  });
  ExpandGram(keyframe, camera);
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

void ChainElimination::OpenSlots(int slots) {
  if (first_place_ + slots > places_) {
    // All move to the first places; every entry moves up or left, so that
    // ascending order never overwrites what is still to be read.
    const int from = Pose(0), to = fixed_, size = PosesSize();
    for (int j = 0; j < fixed_; ++j) {
      std::memmove(&Front(to, j), &Front(from, j), size * sizeof(double));
    }
    for (int j = 0; j < size; ++j) {
      std::memmove(&Front(to + j, to + j),
                   &Front(from + j, from + j),
                   (size - j) * sizeof(double));
    }
    first_place_ = 0;
  }
  for (; slots_ < slots; ++slots_) {
    const int row = Pose(slots_);
    const auto clear = [&](int column) {
      double* entries = &Front(row, column);
      for (int i = 0; i < kPose; ++i) entries[i] = 0;
    };
    for (int j = 0; j < fixed_; ++j) clear(j);
    for (int j = Pose(0); j < row + kPose; ++j) clear(j);
  }
}

// The panel of a landmark from its sums. Returns its information.
Eigen::Matrix3d ChainElimination::PreparePanel(int landmark,
                                               double* panel,
                                               int stride) {
  const double* prior = &landmark_priors_[9 * landmark];
  Eigen::Matrix3d H;
  for (int j = 0; j < 3; ++j) {
    double* row = panel + j * stride;
    Zero(row, fixed_ - landmark_place_);
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

void ChainElimination::SetRoot(int landmark, Eigen::Matrix3d information) {
  Eigen::Matrix3d& L = information;
  GuardedCholesky<3>(&L);
  double* root = &roots_[6 * landmark];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < i; ++j) root[i * (i + 1) / 2 + j] = L(i, j);
    root[i * (i + 1) / 2 + i] = 1 / L(i, i);
  }
}

// Puts a landmark that is kept into the front, instead of eliminating it; its
// panel eliminates nothing.
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
  const Panel& first = panel_of_landmark_[group.front()];
  const int stride = first.stride;
  const int shared = fixed_ - landmark_place_;
  const int slots = structure_.Slots(group.front());
  const int depth = 3 * static_cast<int>(group.size());
  depths_.assign(slots, 0);
  for (const int m : group) depths_[structure_.Slots(m) - 1] += 3;
  for (int s = slots - 1; s > 0; --s) depths_[s - 1] += depths_[s];
  for (const int m : group) {
    double* panel = &panels_[panel_of_landmark_[m].begin];
    const Eigen::Matrix3d information = PreparePanel(m, panel, stride);
    if (kept_landmarks_[m] == kEliminated) {
      SetRoot(m, information);
    } else {
      KeepLandmark(m, information, panel, stride);
    }
  }
  const double* panel = &panels_[first.begin];
  const ConstPanel by_shared = {panel, stride};
  const ConstPanel by_pose = {panel + shared, stride};
  WithKernels([&](auto kernels) {
    for (const int m : group) {
      kernels.SolveThreeRows(&roots_[6 * m],
                             &panels_[panel_of_landmark_[m].begin],
                             stride,
                             shared + structure_.Slots(m) * kPose);
    }
    kernels.AddSquare(-1,
                      by_shared,
                      shared,
                      depth,
                      nullptr,
                      1,
                      FrontAt(landmark_place_, landmark_place_));
    kernels.AddStaircase(-1,
                         by_pose,
                         slots * kPose,
                         depths_.data(),
                         kPose,
                         by_shared,
                         landmark_shared_ + 1,
                         FrontAt(Pose(0), landmark_place_));
    kernels.AddSquare(-1,
                      by_pose,
                      slots * kPose,
                      0,
                      depths_.data(),
                      kPose,
                      FrontAt(Pose(0), Pose(0)));
  });
}

// Brings the pose in `slot` to slot 1, and that to `slot`.
void ChainElimination::SwapPoses(int slot) {
  if (slot == 1) return;
  const auto entry = [&](int i, int j) -> double& {
    return i >= j ? Front(i, j) : Front(j, i);
  };
  const int a = Pose(1), b = Pose(slot), end = Pose(slots_);
  for (int n = 0; n < kPose; ++n) {
    // The rest of the front, but for the two blocks themselves.
    for (int j = 0; j < end; ++j) {
      if (j >= fixed_ && j < Pose(0)) continue;
      if ((j >= a && j < a + kPose) || (j >= b && j < b + kPose)) continue;
      std::swap(entry(a + n, j), entry(b + n, j));
    }
    for (int j = 0; j <= n; ++j)
      std::swap(Front(a + n, a + j), Front(b + n, b + j));
    for (int j = 0; j < n; ++j)
      std::swap(Front(b + n, a + j), Front(b + j, a + n));
  }
}

void ChainElimination::BeginKeyframe() {
  if (begun_) return;
  begun_ = true;
  OpenSlots(static_cast<int>(structure_.Poses(current_).size()));
  const int pose = Pose(0);
  for (int i = 0; i < kPose; ++i) {
    const double* row =
        &keyframe_sums_[(current_ * kPose + i) * keyframe_stride_];
    for (int j = 0; j <= i; ++j) Front(pose + i, pose + j) += row[j];
    for (int c = 0; c <= landmark_shared_; ++c) {
      Front(pose + i, landmark_place_ + c) += row[kPose + c];
    }
  }
  EliminateLandmarks();
  SwapPoses(structure_.SwapWithNext(current_));
}

void ChainElimination::AddPrior(const ChainStateMatrix& information) {
  BeginKeyframe();
  const int pose = Pose(0);
  for (int i = 0; i < kPose; ++i) {
    for (int j = 0; j <= i; ++j) Front(pose + i, pose + j) += information(i, j);
    for (int j = 0; j < kMotion; ++j) {
      Front(pose + i, kMotionPlace + j) += information(i, kPose + j);
    }
  }
  for (int i = 0; i < kMotion; ++i) {
    for (int j = 0; j <= i; ++j) {
      Front(kMotionPlace + i, kMotionPlace + j) +=
          information(kPose + i, kPose + j);
    }
  }
}

void ChainElimination::AddKeptBias(int kept, const KeptBiasRows& rows) {
  BeginKeyframe();
  for (int m = 0; m < rows.residual.size(); ++m) {
    const int bias = kMotionPlace + 3 + m;
    const int place = kKeptPlace + kept + m;
    const double a = rows.by_bias[m], b = rows.by_kept[m];
    Front(bias, bias) += a * a;
    Front(place, bias) += a * b;
    Front(place, place) += b * b;
    Front(constant_, bias) += a * rows.residual[m];
    Front(constant_, place) += b * rows.residual[m];
  }
}

// Moves the current state from the front to information_ and coupling_, the
// latter in the places of what stays; its motion leaves zeros for the next.
void ChainElimination::TakeState() {
  const int pose = Pose(0);
  const int rest = PosesSize() - kPose;
  auto S = information_.topLeftCorner<kState, kState>();
  for (int i = 0; i < kPose; ++i) {
    double* y = Row(&coupling_, i);
    for (int j = 0; j < fixed_; ++j) y[j] = Front(pose + i, j);
    for (int j = 0; j < kMotion; ++j) S(kPose + j, i) = y[kMotionPlace + j];
    for (int j = i; j < kPose; ++j) S(j, i) = Front(pose + j, pose + i);
    std::copy_n(&Front(pose + kPose, pose + i), rest, y + fixed_);
  }
  for (int m = 0; m < kMotion; ++m) {
    const int at = kMotionPlace + m;
    double* y = Row(&coupling_, kPose + m);
    for (int j = 0; j < at; ++j) y[j] = Front(at, j);
    for (int j = at; j < fixed_; ++j) y[j] = Front(j, at);
    for (int j = m; j < kMotion; ++j)
      S(kPose + j, kPose + m) = y[kMotionPlace + j];
    std::copy_n(&Front(pose + kPose, at), rest, y + fixed_);
    for (int j = 0; j < at; ++j) Front(at, j) = 0;
    Zero(&Front(at, at), fixed_ - at);
    Zero(&Front(pose, at), rest + kPose);
  }
  S.triangularView<Eigen::StrictlyUpper>() = S.transpose();
  for (int k = 0; k < kState; ++k) {
    double* y = Row(&coupling_, k);
    Zero(y + kMotionPlace, kMotion);
    Zero(y + fixed_ + rest, kZeros);
  }
  ++first_place_;
  --slots_;
}

// Puts x0 = A e + G z into x0^T S x0 + 2 x0^T Y z, and keeps Z = Y + S G.
// G^T S G + G^T Y + Y^T G = G^T H + H^T G with H = Y + S G / 2.
void ChainElimination::Substitute(const ChainTransition& link) {
  alignas(64) double by_S[kTileState][32];
  const int size = fixed_ + PosesSize();
  for (int k = 0; k < kState; ++k) {
    std::copy_n(Row(&coupling_, k), size + kZeros, Row(&substituted_, k));
    std::copy_n(Row(&coupling_, k), fixed_ + kPose, Row(&half_, k));
    Zero(Row(&half_, k) + fixed_ + kPose, kPanelPad);
  }
  WithKernels([&](auto kernels) {
    kernels.SetProduct({&link.G[0][0], 32},
                       kLinkColumns,
                       {information_.data(), kTileState},
                       kTileState,
                       kState,
                       {&by_S[0][0], 32});
  });
  const auto add = [&](double factor, const double* terms, double* to) {
    for (int c = 0; c < kKeptPlace; ++c) to[c] += factor * terms[c];
    to[constant_] += factor * terms[kTransitionConstant];
    for (int c = 0; c < kPose; ++c) {
      to[fixed_ + c] += factor * terms[kTransitionNextPose + c];
    }
  };
  for (int k = 0; k < kState; ++k) {
    add(1, by_S[k], Row(&substituted_, k));
    add(0.5, by_S[k], Row(&half_, k));
  }

  // H^T G over what is fixed and the next pose, both ways round.
  const int size_f = fixed_ + kPose;
  const int stride = size_f + kPanelPad;
  WithKernels([&](auto kernels) {
    kernels.SetProduct({half_.data(), panel_stride_},
                       size_f,
                       {&link.G[0][0], 32},
                       kLinkColumns,
                       kState,
                       {link_terms_.data(), stride});
  });
  const int pose = Pose(0);
  const auto place = [&](int i) { return i < fixed_ ? i : pose + i - fixed_; };
  const auto fold = [&](int column, int to) {
    const double* terms = &link_terms_[column * stride];
    const int at = place(to);
    for (int i = 0; i < to; ++i) Front(at, place(i)) += terms[i];
    Front(at, at) += 2 * terms[to];
    for (int i = to + 1; i < size_f; ++i) Front(place(i), at) += terms[i];
  };
  for (int c = 0; c < kKeptPlace; ++c) fold(c, c);
  fold(kTransitionConstant, constant_);
  for (int c = 0; c < kPose; ++c) {
    fold(kTransitionNextPose + c, fixed_ + c);
  }

  // Y^T G between the other poses and the next one.
  const int rest = PosesSize() - kPose;
  if (rest == 0) return;
  WithKernels([&](auto kernels) {
    kernels.AddProduct(1,
                       {coupling_.data() + size_f, panel_stride_},
                       rest,
                       {&link.G[0][kTransitionNextPose], 32},
                       kPose,
                       kState,
                       FrontAt(pose + kPose, pose));
  });
}

// root_ = A L^-T with L L^T = M, by rows; A is the transpose of `panel`.
void ChainElimination::FindRoot(double (*M)[16], double (*panel)[16]) {
  WithKernels([&](auto kernels) {
    kernels.FactorAndSolve(kState, &M[0][0], 16, &panel[0][0], 16, kState);
  });
  for (int i = 0; i < kState; ++i) {
    for (int j = 0; j < kState; ++j) {
      root_[i][j] = panel[j][i];
      root_transposed_[i][j] = panel[i][j];
    }
  }
}

// M = I + A^T S A.
void ChainElimination::FindRootOf(const ChainTransition& link) {
  alignas(64) double by_S[kTileState][16];
  alignas(64) double M[kTileState][16];
  alignas(64) double panel[kState][16];
  const ConstPanel A = {&link.A[0][0], 16};
  WithKernels([&](auto kernels) {
    kernels.SetProduct(A,
                       kState,
                       {information_.data(), kTileState},
                       kTileState,
                       kState,
                       {&by_S[0][0], 16});
    kernels.SetProduct(
        {&by_S[0][0], 16}, kState, A, kTileState, kState, {&M[0][0], 16});
  });
  for (int i = 0; i < kState; ++i) {
    M[i][i] += 1;
    for (int j = 0; j < kState; ++j) panel[i][j] = link.A[j][i];
  }
  FindRoot(M, panel);
}

// P = root^T Z, and takes P^T P from the front, but for the poses with what is
// fixed.
void ChainElimination::Eliminate(const std::vector<double>& terms) {
  const int size = fixed_ + PosesSize();
  const int pose = Pose(0);
  const ConstPanel by_fixed = {product_.data(), panel_stride_};
  const ConstPanel by_pose = {product_.data() + fixed_, panel_stride_};
  for (int k = 0; k < kState; ++k) Zero(Row(&product_, k) + size, kZeros);
  WithKernels([&](auto kernels) {
    kernels.SetProduct({terms.data(), panel_stride_},
                       size,
                       {&root_[0][0], 16},
                       kTileState,
                       kState,
                       {product_.data(), panel_stride_});
    kernels.AddSquare(-1, by_fixed, fixed_, kState, nullptr, 1, FrontAt(0, 0));
    kernels.AddSquare(
        -1, by_pose, PosesSize(), kState, nullptr, 1, FrontAt(pose, pose));
  });
}

// What Eliminate() leaves: of the next pose, whose G is in the front already,
// -P^T P; and of all others, whose Z is Y,
//   Y^T G - P^T P = Y^T (G - root P).
void ChainElimination::AddPosesWithFixed(const ChainTransition& link) {
  alignas(64) double next[kState][16] = {};
  for (int k = 0; k < kState; ++k) {
    std::copy_n(Row(&product_, k) + fixed_, kPose, next[k]);
    Zero(Row(&half_, k), fixed_);
    std::copy_n(link.G[k], kKeptPlace, Row(&half_, k));
    Row(&half_, k)[constant_] = link.G[k][kTransitionConstant];
  }
  const ConstPanel by_fixed = {product_.data(), panel_stride_};
  const int pose = Pose(0);
  WithKernels([&](auto kernels) {
    kernels.AddProduct(-1,
                       {&next[0][0], 16},
                       kPose,
                       by_fixed,
                       constant_ + 1,
                       kState,
                       FrontAt(pose, 0));
    if (PosesSize() == kPose) return;
    kernels.AddProduct(-1,
                       by_fixed,
                       fixed_,
                       {&root_transposed_[0][0], 16},
                       kTileState,
                       kState,
                       {half_.data(), panel_stride_});
    kernels.AddProduct(1,
                       {coupling_.data() + fixed_ + kPose, panel_stride_},
                       PosesSize() - kPose,
                       {half_.data(), panel_stride_},
                       constant_ + 1,
                       kState,
                       FrontAt(pose + kPose, 0));
  });
}

void ChainElimination::RecordStep(const ChainTransition* link) {
  if (record_ == Record::kNothing) return;
  const int size = fixed_ + PosesSize();
  Step& step = steps_.emplace_back();
  step.product = products_.size();
  step.stride = size;
  step.linked = link != nullptr;
  if (link != nullptr) step.link = *link;
  std::memcpy(step.root, root_, sizeof(root_));
  for (int k = 0; k < kState; ++k) {
    const double* row = Row(&product_, k);
    products_.insert(products_.end(), row, row + size);
  }
}

void ChainElimination::Advance(const ChainTransition& link) {
  BeginKeyframe();
  TakeState();
  Substitute(link);
  FindRootOf(link);
  Eliminate(substituted_);
  AddPosesWithFixed(link);
  RecordStep(&link);
  ++current_;
  begun_ = false;
}

// Eliminates the state that was taken by its own information alone.
void ChainElimination::EliminateByItself() {
  alignas(64) double M[kState][16] = {};
  alignas(64) double panel[kState][16] = {};
  for (int i = 0; i < kState; ++i) {
    for (int j = 0; j < kState; ++j) M[i][j] = information_(i, j);
    panel[i][i] = 1;
  }
  FindRoot(M, panel);
  Eliminate(coupling_);
  RecordStep(nullptr);
}

int ChainElimination::Place(int shared) const {
  if (shared < kChainLinkShared) return shared;
  const int landmark = shared - kChainLinkShared;
  return landmark < landmark_shared_ ? landmark_place_ + landmark
                                     : kKeptPlace + landmark - landmark_shared_;
}

void ChainElimination::Finish(SharedInformation* result) {
  BeginKeyframe();
  TakeState();
  EliminateByItself();
  // What cameras alone have in common was summed aside.
  const int rows = landmark_shared_ + 1;
  for (int j = 0; j < landmark_shared_; ++j) {
    for (int i = j; i < rows; ++i) {
      Front(landmark_place_ + i, landmark_place_ + j) +=
          shared_sums_[j * rows + i];
    }
  }
  const int size = shared_size();
  result->Lambda.resize(size, size);
  result->eta.resize(size);
  result->constant = Front(constant_, constant_);
  for (int j = 0; j < size; ++j) {
    for (int i = j; i < size; ++i) {
      const int a = Place(i), b = Place(j);
      const double information = Front(std::max(a, b), std::min(a, b));
      result->Lambda(i, j) = information;
      result->Lambda(j, i) = information;
    }
    result->eta(j) = -Front(constant_, Place(j));
  }
}

}  // namespace selfcal
