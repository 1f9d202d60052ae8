// Elimination of a chain of keyframes and its landmarks down to the parameters
// that all of them share (section IV-A of the paper, step 2): from whitened,
// linearised factors to Lambda and eta of those parameters. Knows nothing of
// what the parameters are.
//
// Minimised is the sum of |r + J d|^2 over all rows plus the priors d^T I d.
// The unknowns are eliminated in time order: a landmark when the oldest
// keyframe that sees it is reached, into the window of the keyframes that see
// it; then that keyframe, leaving
//   [shared | right-hand side | velocity and biases of the next | poses in
//   view]
// as one dense symmetric front. For tracks of bounded length the cost is linear
// in the number of keyframes; a track through the whole chain is as good, and
// costs a front as wide as the chain.
//
// One object is a workspace for one chain at a time: Start() begins the next
// and keeps the memory. Not for use by two threads at once. Deterministic.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace selfcal {

// Unknowns of a keyframe: pose 6, then velocity and biases 9.
inline constexpr int kChainPoseSize = 6;
inline constexpr int kChainMotionSize = 9;
inline constexpr int kChainStateSize = kChainPoseSize + kChainMotionSize;
// Shared parameters that one landmark row can depend on.
inline constexpr int kMaxRowShared = 16;

using ChainStateVector = Eigen::Matrix<double, kChainStateSize, 1>;
using ChainStateMatrix =
    Eigen::Matrix<double, kChainStateSize, kChainStateSize>;

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
// parameters that begins at shared_offset. x0 must be invertible: the next
// state, the shared parameters and the noise determine the state before.
struct LinkRows {
  int shared_offset = 0;
  ChainStateVector residual;
  ChainStateMatrix x0;  // by the keyframe's state
  ChainStateMatrix x1;  // by the next one's
  Eigen::Matrix<double, kChainStateSize, Eigen::Dynamic> shared;
};

// What the chain says about the shared parameters: minimising over all else
// leaves d^T Lambda d - 2 eta^T d + const.
struct SharedInformation {
  Eigen::MatrixXd Lambda;  // symmetric
  Eigen::VectorXd eta;
};

class ChainElimination {
 public:
  // Begins a chain at keyframe 0.
  void Start(int shared_size);

  // The keyframe that is eliminated next.
  int current() const { return current_; }

  // Adds a prior on the current keyframe's state, centred at the linearisation
  // point. Symmetric, positive semidefinite.
  void AddPrior(const ChainStateMatrix& information);

  // Adds and eliminates one landmark. `rows` are all of its rows, sorted by
  // keyframe, the first at or after the current keyframe. prior_information is
  // that of each of its coordinates [1 / unit^2], centred at the linearisation
  // point.
  void AddLandmark(std::span<const LandmarkRows> rows,
                   double prior_information);

  // Eliminates the current keyframe by the rows between it and the next, and
  // goes on to that.
  void Advance(const LinkRows& link);

  // Eliminates the last keyframe. The object needs a Start() after that.
  SharedInformation Finish();

 private:
  // A run of indices of the front.
  struct Run {
    int begin;
    int end;
  };

  // Places in the front: [shared | rhs | motion | poses ...].
  int rhs() const { return shared_size_; }
  int motion() const { return shared_size_ + 1; }
  int pose(int slot) const {
    return motion() + kChainMotionSize + slot * kChainPoseSize;
  }
  int size() const { return pose(slots_); }

  void OpenSlots(int slots);
  void AddRun(int begin, int end);
  void FindRuns(std::span<const LandmarkRows> rows);
  void AddToFront(const LandmarkRows& rows, int pose);
  void AddToPanel(const LandmarkRows& rows, int pose);
  void SubtractLandmarkPanel();
  ChainStateMatrix TakeCurrent();
  void CloseGap();
  ChainStateMatrix Substitute(const LinkRows& link,
                              const ChainStateMatrix& current);
  void SubtractStatePanel();

  int shared_size_ = 0;
  int current_ = 0;
  int slots_ = 0;  // poses in the front
  // Lower triangle of the front's information matrix; allocated larger than
  // size() so that it seldom grows.
  Eigen::MatrixXd front_;
  Eigen::Matrix<double, Eigen::Dynamic, 3> landmark_panel_;
  // One row for each of the front.
  using StatePanel = Eigen::Matrix<double, Eigen::Dynamic, kChainStateSize>;
  StatePanel coupling_;  // of the current state with the front
  StatePanel solution_;  // of the current state in terms of the front
  StatePanel product_;
  std::vector<Run> runs_;
};

}  // namespace selfcal
