// Elimination of landmarks and keyframes down to the parameters they share, for
// any graph of keyframes: several chains, and landmarks that connect keyframes
// far apart in time. (Where there is one chain, ChainElimination is faster.)
//
// Landmarks are eliminated one by one into blocks between the poses that see
// them; the keyframes then by a sparse Cholesky factorisation with a
// fill-reducing order. Not for use by two threads at once. Deterministic.
#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/elimination/chain_elimination.h"

namespace selfcal {

// Shared parameters that one landmark row can depend on.
inline constexpr int kMaxRowShared = 16;

// Two whitened rows that connect one landmark, the pose of one keyframe, and a
// run of shared parameters that begins at shared_offset.
struct LandmarkRows {
  int keyframe = 0;
  int shared_offset = 0;
  Eigen::Vector2d residual;
  Eigen::Matrix<double, 2, kChainPoseSize> pose;
  Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, kMaxRowShared> shared;
  Eigen::Matrix<double, 2, 3> landmark;
};

// Fifteen whitened rows between a keyframe and the next, and a run of shared
// parameters that begins at shared_offset.
struct LinkRows {
  int shared_offset = 0;
  ChainStateVector residual;
  ChainStateMatrix x0;  // by the keyframe's state
  ChainStateMatrix x1;  // by the next one's
  Eigen::Matrix<double, kChainStateSize, Eigen::Dynamic> shared;
};

class SparseElimination {
 public:
  SparseElimination(int keyframes, int shared_size);

  // Adds x^T information x on the state of a keyframe, centred at the
  // linearisation point.
  void AddPrior(int keyframe, const ChainStateMatrix& information);

  // Adds rows between two keyframes, before < after.
  void AddLink(int before, int after, const LinkRows& rows);

  // Adds and eliminates one landmark. `rows` are all of its rows, sorted by
  // keyframe. The prior has the given information about the third coordinate,
  // and its residual there; rows and prior together must determine the
  // landmark.
  void AddLandmark(std::span<const LandmarkRows> rows,
                   double prior_information,
                   double prior_residual);

  // Eliminates all keyframes. Nothing if the states are not determined.
  std::optional<SharedInformation> Eliminate() const;

 private:
  using Pair = std::pair<int, int>;  // of keyframes, first <= second
  using PoseBlock = Eigen::Matrix<double, kChainPoseSize, kChainPoseSize>;

  int keyframes_;
  int shared_size_;
  std::map<Pair, ChainStateMatrix> states_;
  std::map<Pair, PoseBlock> poses_;
  // Keyframes by [shared | right-hand side], the latter being -J^T r.
  Eigen::MatrixXd keyframe_shared_;
  // [shared | right-hand side] by the same; lower triangle only.
  Eigen::MatrixXd shared_;
};

}  // namespace selfcal
