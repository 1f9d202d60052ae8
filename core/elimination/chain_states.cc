// Elimination of one state of a chain, by its link to the next or by its own
// information.
#include <algorithm>
#include <cstring>

#include "core/elimination/chain_elimination.h"
#include "core/elimination/chain_places.h"

namespace selfcal {

using namespace chain;

// Moves the current state from the front to information_ and coupling_, the
// latter at the places of the remaining unknowns; its motion leaves zeros for
// the next.
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

// Substitutes x0 = A e + G z into x0^T S x0 + 2 x0^T Y z, and stores
//   Z = Y + S G.
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

  // H^T G over the fixed part and the next pose, in both directions.
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

// root_ = A L^-T with L L^T = M, row-major; A is the transpose of `panel`.
void ChainElimination::FindRoot(double (*M)[16], double (*panel)[16]) {
  WithKernels([&](auto kernels) {
    kernels.FactorAndSolve(kState, &M[0][0], 16, &panel[0][0], 16, kState);
  });
  for (int i = 0; i < kState; ++i) {
    for (int j = 0; j < kState; ++j) {
      root_[i][j] = panel[j][i];
      root_transposed_[i][j] = panel[i][j];
      factor_[i][j] = M[i][j];
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

// Computes P = root^T Z, and subtracts P^T P from the front, except for the
// products of poses with the fixed part.
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
    kernels.AddSquare(-1, by_fixed, fixed_, kState, FrontAt(0, 0));
    kernels.AddSquare(-1, by_pose, PosesSize(), kState, FrontAt(pose, pose));
  });
}

// The products that Eliminate() omits: for the next pose, whose G is in the
// front already, -P^T P; and for all others, whose Z is Y,
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

// Reserves exactly the memory for the recorded steps.
void ChainElimination::ReserveSteps() {
  const int keyframes = structure_.keyframes();
  std::size_t size = 0;
  for (int k = 0; k < keyframes; ++k) {
    const int rest = static_cast<int>(structure_.Poses(k).size()) - 1;
    size += static_cast<std::size_t>(kState) * (fixed_ + rest * kPose);
  }
  steps_.reserve(keyframes);
  products_.reserve(size);
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
  std::memcpy(step.factor, factor_, sizeof(factor_));
  for (int k = 0; k < kState; ++k) {
    const double* row = Row(&product_, k);
    products_.insert(products_.end(), row, row + size);
  }
}

// Eliminates the current state by its own information alone.
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

}  // namespace selfcal
