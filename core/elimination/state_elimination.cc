#include "core/elimination/state_elimination.h"

#include <algorithm>
#include <cstddef>

#include "core/elimination/chain_kernels.h"

namespace selfcal {

using namespace chain;

void StateElimination::Start(const ChainLayout& layout,
                             const ChainStructure& structure) {
  layout_ = layout;
  panel_stride_ =
      layout.fixed + WholeVectors(structure.max_slots() * kPose) + kZeros;
  for (auto* panel : {&coupling_, &substituted_, &product_, &half_}) {
    GrowTo(static_cast<std::size_t>(tile()) * panel_stride_, panel);
  }
  GrowTo(static_cast<std::size_t>(layout.fixed + kPose + kPanelPad) *
             layout.columns().pose_end,
         &link_terms_);
  information_.setZero();
  root_ = {};
}

void StateElimination::TakeMemory(StateElimination* finished) {
  for (const auto buffer : {&StateElimination::coupling_,
                            &StateElimination::substituted_,
                            &StateElimination::product_,
                            &StateElimination::half_,
                            &StateElimination::link_terms_}) {
    (this->*buffer).swap(finished->*buffer);
  }
}

EliminatedState StateElimination::ByLink(const ChainTransition& link,
                                         ChainFront* front) {
  TakeState(front);
  Substitute(link, front);
  FindRootOf(link);
  const EliminatedState result = Eliminate(substituted_, front);
  AddPosesWithFixed(link, front);
  AddRows(link, front);
  return result;
}

EliminatedState StateElimination::ByItself(ChainFront* front) {
  TakeState(front);
  alignas(64) StateRoot::Rows M = {};
  alignas(64) StateRoot::Rows panel = {};
  for (int i = 0; i < state(); ++i) {
    for (int j = 0; j < state(); ++j) M[i][j] = information_(i, j);
    panel[i][i] = 1;
  }
  FindRoot(&M, &panel);
  return Eliminate(coupling_, front);
}

// Moves the current state from the front to information_ and coupling_, the
// latter at the places of the remaining unknowns; its motion leaves zeros for
// the next.
void StateElimination::TakeState(ChainFront* all) {
  ChainFront& front = *all;
  const int fixed = layout_.fixed, motion = layout_.motion_place();
  const int pose = front.Pose(0);
  const int rest = front.PosesSize() - kPose;
  const int motion_size = layout_.motion_size;
  auto S = information_.topLeftCorner(state(), state());
  for (int i = 0; i < kPose; ++i) {
    double* y = Row(&coupling_, i);
    for (int j = 0; j < fixed; ++j) y[j] = front(pose + i, j);
    for (int j = 0; j < motion_size; ++j) S(kPose + j, i) = y[motion + j];
    for (int j = i; j < kPose; ++j) S(j, i) = front(pose + j, pose + i);
    std::copy_n(&front(pose + kPose, pose + i), rest, y + fixed);
  }
  for (int m = 0; m < motion_size; ++m) {
    const int at = motion + m;
    double* y = Row(&coupling_, kPose + m);
    for (int j = 0; j < at; ++j) y[j] = front(at, j);
    for (int j = at; j < fixed; ++j) y[j] = front(j, at);
    for (int j = m; j < motion_size; ++j)
      S(kPose + j, kPose + m) = y[motion + j];
    std::copy_n(&front(pose + kPose, at), rest, y + fixed);
    for (int j = 0; j < at; ++j) front(at, j) = 0;
    Zero(&front(at, at), fixed - at);
    Zero(&front(pose, at), rest + kPose);
  }
  S.triangularView<Eigen::StrictlyUpper>() = S.transpose();
  for (int k = 0; k < state(); ++k) {
    double* y = Row(&coupling_, k);
    Zero(y + motion, motion_size);
    Zero(y + fixed + rest, kZeros);
  }
  front.CloseSlot();
}

// Substitutes x0 = A e + G z into x0^T S x0 + 2 x0^T Y z, and stores
//   Z = Y + S G.
// G^T S G + G^T Y + Y^T G = G^T H + H^T G with H = Y + S G / 2.
void StateElimination::Substitute(const ChainTransition& link,
                                  ChainFront* front) {
  alignas(64) double by_S[kMaxTileState * kMaxTransitionColumns];
  const TransitionColumns& at = link.columns;
  const int fixed = layout_.fixed;
  const int size = fixed + front->PosesSize();
  for (int k = 0; k < state(); ++k) {
    std::copy_n(Row(&coupling_, k), size + kZeros, Row(&substituted_, k));
    std::copy_n(Row(&coupling_, k), fixed + kPose, Row(&half_, k));
    Zero(Row(&half_, k) + fixed + kPose, kPanelPad);
  }
  WithKernels(width_, [&](auto kernels) {
    kernels.SetProduct({link.G, at.stride},
                       at.pose_end,
                       {information_.data(), kMaxTileState},
                       tile(),
                       state(),
                       {by_S, at.stride});
  });
  const auto add = [&](double factor, const double* terms, double* to) {
    for (int c = 0; c < at.constant; ++c) to[c] += factor * terms[c];
    to[layout_.constant] += factor * terms[at.constant];
    for (int c = 0; c < kPose; ++c) {
      to[fixed + c] += factor * terms[at.next_pose + c];
    }
  };
  for (int k = 0; k < state(); ++k) {
    const double* terms = by_S + k * at.stride;
    add(1, terms, Row(&substituted_, k));
    add(0.5, terms, Row(&half_, k));
  }
  AddHalf(link, front);

  // Y^T G between the other poses and the next one.
  const int rest = front->PosesSize() - kPose;
  if (rest == 0) return;
  const int pose = front->Pose(0);
  WithKernels(width_, [&](auto kernels) {
    kernels.AddProduct(1,
                       {coupling_.data() + fixed + kPose, panel_stride_},
                       rest,
                       {link.G + at.next_pose, at.stride},
                       kPose,
                       state(),
                       front->At(pose + kPose, pose));
  });
}

// Adds H^T G over the fixed part and the next pose, in both directions.
void StateElimination::AddHalf(const ChainTransition& link, ChainFront* all) {
  ChainFront& front = *all;
  const TransitionColumns& columns = link.columns;
  const int fixed = layout_.fixed;
  const int size_f = fixed + kPose;
  const int stride = size_f + kPanelPad;
  WithKernels(width_, [&](auto kernels) {
    kernels.SetProduct({half_.data(), panel_stride_},
                       size_f,
                       {link.G, columns.stride},
                       columns.pose_end,
                       state(),
                       {link_terms_.data(), stride});
  });
  const int pose = front.Pose(0);
  const auto place = [&](int i) { return i < fixed ? i : pose + i - fixed; };
  const auto fold = [&](int column, int to) {
    const double* terms = &link_terms_[column * stride];
    const int at = place(to);
    for (int i = 0; i < to; ++i) front(at, place(i)) += terms[i];
    front(at, at) += 2 * terms[to];
    for (int i = to + 1; i < size_f; ++i) front(place(i), at) += terms[i];
  };
  for (int c = 0; c < columns.constant; ++c) fold(c, c);
  fold(columns.constant, layout_.constant);
  for (int c = 0; c < kPose; ++c) fold(columns.next_pose + c, fixed + c);
}

// root = A L^-T with L L^T = M, row-major; A is the transpose of `panel`.
void StateElimination::FindRoot(StateRoot::Rows* M, StateRoot::Rows* panel) {
  WithKernels(width_, [&](auto kernels) {
    kernels.FactorAndSolve(state(),
                           &(*M)[0][0],
                           kMaxTileState,
                           &(*panel)[0][0],
                           kMaxTileState,
                           state());
  });
  for (int i = 0; i < state(); ++i) {
    for (int j = 0; j < state(); ++j) {
      root_.root[i][j] = (*panel)[j][i];
      root_.transposed[i][j] = (*panel)[i][j];
      root_.factor[i][j] = (*M)[i][j];
    }
  }
}

// M = I + A^T S A.
void StateElimination::FindRootOf(const ChainTransition& link) {
  alignas(64) StateRoot::Rows by_S;
  alignas(64) StateRoot::Rows M;
  alignas(64) StateRoot::Rows panel;
  const int noise = link.noise();
  const ConstPanel A = {link.A, noise};
  const ConstPanel terms = {&by_S[0][0], kMaxTileState};
  WithKernels(width_, [&](auto kernels) {
    kernels.SetProduct(A,
                       state(),
                       {information_.data(), kMaxTileState},
                       tile(),
                       state(),
                       {&by_S[0][0], kMaxTileState});
    kernels.SetProduct(
        terms, state(), A, tile(), state(), {&M[0][0], kMaxTileState});
  });
  for (int i = 0; i < state(); ++i) {
    M[i][i] += 1;
    for (int j = 0; j < state(); ++j) panel[i][j] = link.A[j * noise + i];
  }
  FindRoot(&M, &panel);
}

// Computes P = root^T Z, and subtracts P^T P from the front, except for the
// products of poses with the fixed part.
EliminatedState StateElimination::Eliminate(const std::vector<double>& terms,
                                            ChainFront* front) {
  const int fixed = layout_.fixed;
  const int poses = front->PosesSize();
  const int size = fixed + poses;
  const int pose = front->Pose(0);
  const ConstPanel by_fixed = {product_.data(), panel_stride_};
  const ConstPanel by_pose = {product_.data() + fixed, panel_stride_};
  for (int k = 0; k < state(); ++k) Zero(Row(&product_, k) + size, kZeros);
  WithKernels(width_, [&](auto kernels) {
    kernels.SetProduct({terms.data(), panel_stride_},
                       size,
                       {&root_.root[0][0], kMaxTileState},
                       tile(),
                       state(),
                       {product_.data(), panel_stride_});
    kernels.AddSquare(-1, by_fixed, fixed, state(), front->At(0, 0));
    kernels.AddSquare(-1, by_pose, poses, state(), front->At(pose, pose));
  });
  return {root_, by_fixed, size};
}

// The products that Eliminate() omits: for the next pose, whose G is in the
// front already, -P^T P; and for all others, whose Z is Y,
//   Y^T G - P^T P = Y^T (G - root P).
void StateElimination::AddPosesWithFixed(const ChainTransition& link,
                                         ChainFront* front) {
  const int fixed = layout_.fixed;
  const int rest = front->PosesSize() - kPose;
  alignas(64) double next[kMaxChainStateSize][kPanelPad] = {};
  for (int k = 0; k < state(); ++k) {
    std::copy_n(Row(&product_, k) + fixed, kPose, next[k]);
    Zero(Row(&half_, k), fixed);
    const double* G = link.G + k * link.columns.stride;
    std::copy_n(G, link.columns.constant, Row(&half_, k));
    Row(&half_, k)[layout_.constant] = G[link.columns.constant];
  }
  const ConstPanel by_fixed = {product_.data(), panel_stride_};
  const int pose = front->Pose(0);
  WithKernels(width_, [&](auto kernels) {
    kernels.AddProduct(-1,
                       {&next[0][0], kPanelPad},
                       kPose,
                       by_fixed,
                       layout_.constant + 1,
                       state(),
                       front->At(pose, 0));
    if (rest == 0) return;
    kernels.AddProduct(-1,
                       by_fixed,
                       fixed,
                       {&root_.transposed[0][0], kMaxTileState},
                       tile(),
                       state(),
                       {half_.data(), panel_stride_});
    kernels.AddProduct(1,
                       {coupling_.data() + fixed + kPose, panel_stride_},
                       rest,
                       {half_.data(), panel_stride_},
                       layout_.constant + 1,
                       state(),
                       front->At(pose + kPose, 0));
  });
}

// Adds the further rows of a link, which are over the link parameters, the next
// state and the constant: these are in the front by now.
void StateElimination::AddRows(const ChainTransition& link,
                               ChainFront* front) const {
  const TransitionColumns& columns = link.columns;
  const int pose = front->Pose(0);
  const auto place = [&](int column) {
    if (column < columns.constant) return column;
    return column == columns.constant ? layout_.constant
                                      : pose + column - columns.next_pose;
  };
  for (int row = 0; row < link.rows; ++row) {
    const double* h = link.H + row * columns.stride;
    for (int i = 0; i < columns.pose_end; ++i) {
      if (i >= columns.motion_end && i < columns.constant) continue;
      for (int j = 0; j <= i; ++j) {
        if (j >= columns.motion_end && j < columns.constant) continue;
        const int a = place(i), b = place(j);
        (*front)(std::max(a, b), std::min(a, b)) += h[i] * h[j];
      }
    }
  }
}

}  // namespace selfcal
