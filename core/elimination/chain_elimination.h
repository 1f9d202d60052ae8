// Eliminates a chain of keyframes and its landmarks down to the parameters that
// all of them share (section IV-A of the paper, step 2): from whitened,
// linearised factors to Lambda and eta of those parameters; and
// back-substitutes a step of those parameters to the steps of all other
// unknowns.
//
// The shared parameters, in this order: link parameters (the tangent of the
// IMU), camera parameters (the tangent of each camera), kept unknowns. A score
// (SegmentLineariser, core/information) and a recalibration (LinearSystem,
// core/calibration) use it alike.
//
// It minimises the sum of |r + J d|^2 over all factors plus the priors, in the
// order of chain_structure.h. At any time the remaining system is one dense
// symmetric front
//   [link parameters | motion of a keyframe | kept | camera parameters | 1 |
//    poses]
// where the motion (velocity and biases of each IMU) is that of the current
// keyframe, and the kept unknowns are shared with other chains: landmarks that
// they observe as well, biases that walk from one to the next, and states at
// which they are joined. For tracks of bounded length the cost is linear in the
// number of keyframes; a track through the whole chain gives the same result,
// at the cost of a front as wide as the chain.
//
// A link between a keyframe and the next is given solved for the earlier state,
//   x0 = A e + G z,
// with white e of unit information: the noise is eliminated instead of squaring
// rows, so that weak information is not lost beside information that is 10^7
// times stronger.
//
// The phases: observations are summed to normal equations of landmarks and of
// keyframes; then for each keyframe in turn, its landmarks and its state are
// eliminated from the front, and recorded for the back-substitution.
//
// One object is a workspace for one chain at a time: Start() begins the next
// chain and reuses the memory, so that nothing is allocated after the largest.
// Not thread-safe. Deterministic for one width of vectors.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/elimination/chain_front.h"
#include "core/elimination/chain_layout.h"
#include "core/elimination/chain_posterior.h"
#include "core/elimination/chain_record.h"
#include "core/elimination/chain_shape.h"
#include "core/elimination/chain_structure.h"
#include "core/elimination/chain_transition.h"
#include "core/elimination/chain_unknowns.h"
#include "core/elimination/keyframe_equations.h"
#include "core/elimination/landmark_elimination.h"
#include "core/elimination/landmark_equations.h"
#include "core/elimination/observation_products.h"
#include "core/elimination/state_elimination.h"
#include "core/simd/vector_width.h"

namespace selfcal {

// Six rows (by_bias b + by_kept x + residual), one for each component of the
// biases of a keyframe and of six kept unknowns x.
struct KeptBiasRows {
  Eigen::Matrix<double, 6, 1> by_bias = Eigen::Matrix<double, 6, 1>::Zero();
  Eigen::Matrix<double, 6, 1> by_kept = Eigen::Matrix<double, 6, 1>::Zero();
  Eigen::Matrix<double, 6, 1> residual = Eigen::Matrix<double, 6, 1>::Zero();
};

// Information of the chain about the shared parameters: minimising over all
// other unknowns gives d^T Lambda d - 2 eta^T d + constant + r, with r the
// squares of the residuals of all factors but transitions, and the constant at
// most the squares of the whitened residuals of the transitions.
struct SharedInformation {
  Eigen::MatrixXd Lambda;  // symmetric
  Eigen::VectorXd eta;
  double constant = 0;
};

class ChainElimination {
 public:
  explicit ChainElimination(VectorWidth width = WidestVectors())
      : width_(width), landmarks_(width), state_(width) {}

  // Begins a chain. Use Record::kSteps if steps will be requested later.
  enum class Record { kNothing, kSteps };
  // Throws std::length_error if the tracks take more than shape.max_bytes.
  void Start(const ChainShape& shape, Record record = Record::kNothing);

  // Takes over the memory of `finished`, after its Finish(), that it would need
  // only for its next chain: its recorded steps stay valid.
  void TakeScratch(ChainElimination* finished);

  using PoseRotation = ChainPoseRotation;

  // First, in any order: the factors of one keyframe and camera, two whitened
  // rows of landmark_rows.h for each observation; `observations` are indices
  // into track_keyframes. The matrix is B of these rows; null: [1; 0].
  void AddObservations(int keyframe,
                       int camera,
                       const double* rows,
                       std::span<const int> observations,
                       const PoseRotation* by_rotation = nullptr);
  // Adds x^T H x + 2 g^T x for a landmark.
  void AddLandmarkPrior(int landmark,
                        const Eigen::Matrix3d& H,
                        const Eigen::Vector3d& g);

  // Then for each keyframe in turn: its prior x^T H x, rows with kept unknowns,
  // if any, and the link to the next, or the end.
  void AddPrior(const ChainStateMatrix& information);
  void AddKeptBias(int kept, const KeptBiasRows& rows);
  // Ties the first unknowns of the state of the keyframe to as many kept ones:
  // their offset has the given information, which must be positive.
  void AddKeptState(int kept, const ChainStateVector& information);
  void Advance(const ChainTransition& link);
  void Finish(SharedInformation* result);

  // After Finish(), with Record::kSteps: the minimising steps for a given step
  // of the shared parameters. Those of a state for each keyframe, 3 for each
  // landmark (p_G, [m]).
  void FindSteps(const Eigen::VectorXd& shared,
                 std::vector<ChainStateVector>* states,
                 std::vector<Eigen::Vector3d>* landmarks) const;

  // The same back-substitution for covariances; `states` as FindSteps gives
  // them for the step of the shared parameters.
  void FindPosterior(const Eigen::VectorXd& shared,
                     const Eigen::MatrixXd& shared_covariance,
                     const std::vector<ChainStateVector>& states,
                     ChainPosterior* posterior) const;

  // Link parameters, camera parameters and kept unknowns.
  int shared_size() const { return layout_.shared_size(); }

 private:
  void BeginKeyframe();
  EliminatedChain Recorded() const { return {layout_, structure_, record_}; }

  VectorWidth width_;
  ChainStructure structure_;
  ChainLayout layout_;
  ObservationProducts products_;
  LandmarkEquations landmark_equations_;
  KeyframeEquations keyframe_equations_;
  ChainFront front_;
  LandmarkElimination landmarks_;
  StateElimination state_;
  ChainRecord record_;
  int current_ = 0;     // keyframe
  bool begun_ = false;  // its slot is open, its landmarks are eliminated
};

}  // namespace selfcal
