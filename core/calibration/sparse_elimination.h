// The linear system of a calibration: whitened, linearised factors in, the
// information of the shared parameters out, and the way back from a step of
// those to the steps of all else. For any graph of keyframes: several chains,
// and landmarks that connect keyframes far apart in time. (Where there is one
// chain, and no way back is needed, ChainElimination is faster.)
//
// Minimised is
//   F(d) = sum |r + J d|^2 over all rows + sum d^T I d over the priors
// over the steps d of the keyframes (15 each, pose first), of the landmarks (3
// each, in the coordinates that their rows are given in) and of the shared
// parameters. What is passed:
//   Start        the number of keyframes and of shared parameters;
//   AddPrior     a symmetric positive semidefinite I on one keyframe, any
//                number of times, the gauge among them;
//   AddLink      fifteen rows between two keyframes. x0 need not be invertible;
//                the links need not form chains;
//   AddLandmark  all rows of one landmark, at least two, sorted by keyframe
//                (several of one keyframe for several cameras), of any
//                keyframes; and the prior (residual + d_2)^2 information on its
//                third coordinate;
//   Eliminate    once, when all is added.
// The shared parameters have no prior in here: the caller adds his to Lambda,
// chooses their step, within a subspace or shortened, and asks for the rest.
//
// Landmarks are eliminated one by one into blocks between the poses that see
// them; the keyframes then by a sparse Cholesky factorisation with a
// fill-reducing order. One object is a workspace for one system at a time. Not
// for use by two threads at once. Deterministic.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
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
  // Begins a system; keeps the memory of the one before.
  void Start(int keyframes, int shared_size);

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
  std::optional<SharedInformation> Eliminate();

  // What the best steps of keyframes and landmarks take off F while the shared
  // parameters stay; with a step s of those, F falls by
  //   decrease + 2 eta^T s - s^T Lambda s. After Eliminate().
  double decrease() const { return -shared_(shared_size_, shared_size_); }

  // The steps that minimise F for a step of the shared parameters. After
  // Eliminate().
  std::vector<ChainStateVector> KeyframeSteps(
      const Eigen::VectorXd& shared_step) const;
  // In the order in which landmarks were added.
  std::vector<Eigen::Vector3d> LandmarkSteps(
      const Eigen::VectorXd& shared_step,
      const std::vector<ChainStateVector>& keyframe_steps) const;

 private:
  using Pair = std::pair<int, int>;  // of keyframes, first <= second
  using PoseBlock = Eigen::Matrix<double, kChainPoseSize, kChainPoseSize>;

  using ByLandmark = Eigen::Matrix<double, kChainPoseSize, 3>;
  // A landmark with information L L^T: what couples to it, times L^-T.
  struct Landmark {
    Eigen::Matrix3d L;
    Eigen::MatrixX3d by_shared;  // the last row is the right-hand side
    std::vector<std::pair<int, ByLandmark>> by_pose;
  };

  int keyframes_ = 0;
  int shared_size_ = 0;
  std::vector<Landmark> landmarks_;
  Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> llt_;
  std::map<Pair, ChainStateMatrix> states_;
  std::map<Pair, PoseBlock> poses_;
  // Keyframes by [shared | right-hand side], the latter being -J^T r.
  Eigen::MatrixXd keyframe_shared_;
  // [shared | right-hand side] by the same; lower triangle only.
  Eigen::MatrixXd shared_;
};

}  // namespace selfcal
