// Eliminates a chain of keyframes and its landmarks down to the parameters that
// all of them share (section IV-A of the paper, step 2): from whitened,
// linearised factors to Lambda and eta of those parameters; and
// back-substitutes a step of those parameters to the steps of all other
// unknowns. The meaning of the parameters is irrelevant here.
//
// It minimises the sum of |r + J d|^2 over all factors plus the priors, in the
// order of chain_structure.h. At any time the remaining system is one dense
// symmetric front
//   [link parameters | motion of a keyframe | kept | landmark parameters | 1 |
//    poses]
// where the motion (velocity and biases) is that of the current keyframe, and
// the kept unknowns are shared with other chains: landmarks that they observe
// as well, biases that walk from one to the next, and states at which they are
// joined. For tracks of bounded length the cost is linear in the number of
// keyframes; a track through the whole chain gives the same result, at the cost
// of a front as wide as the chain.
//
// A link between a keyframe and the next is given solved for the earlier state,
//   x0 = A e + G z,
// with white e of unit information: the noise is eliminated instead of squaring
// rows, so that weak information is not lost beside information that is 10^7
// times stronger.
//
// One object is a workspace for one chain at a time: Start() begins the next
// chain and reuses the memory, so that nothing is allocated after the largest.
// Not thread-safe. Deterministic for one width of vectors.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "core/elimination/chain_structure.h"
#include "core/elimination/chain_transition.h"
#include "core/elimination/dense_lanes.h"
#include "core/simd/vector_width.h"

namespace selfcal {

// Unknowns of a keyframe: pose 6, then velocity and biases 9.
inline constexpr int kChainPoseSize = 6;
inline constexpr int kChainMotionSize = 9;
inline constexpr int kChainStateSize = kChainPoseSize + kChainMotionSize;
// Shared parameters on which links depend; they come first.
inline constexpr int kChainLinkShared = 15;

using ChainStateVector = Eigen::Matrix<double, kChainStateSize, 1>;
using ChainStateMatrix =
    Eigen::Matrix<double, kChainStateSize, kChainStateSize>;

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
// most theirs.
struct SharedInformation {
  Eigen::MatrixXd Lambda;  // symmetric
  Eigen::VectorXd eta;
  double constant = 0;
};

// Posterior of a chain given all factors, the step and the covariance of the
// shared parameters.
struct ChainPosterior {
  // The noise e of each link: its minimiser and its covariance, between zero
  // and the identity, which is its prior.
  std::vector<ChainStateVector> noise;
  std::vector<ChainStateMatrix> noise_covariance;
  std::vector<ChainStateMatrix> state_covariance;  // of each keyframe
  // 15 x shared_size(): covariance of the first and of the last keyframe with
  // the shared parameters.
  Eigen::MatrixXd first_with_shared, last_with_shared;
};

// The observations, as in ChainStructure::Find, and for each camera the number
// of its parameters. They are in the order of the cameras, after the link
// parameters.
struct ChainShape {
  int keyframes = 0;
  std::span<const int> camera_sizes;
  std::span<const int> tracks;
  std::span<const int> track_keyframes;
  // Number of kept unknowns; and for each landmark the first of its three, or
  // -1 if it is eliminated. Empty: all are eliminated.
  int kept = 0;
  std::span<const int> kept_landmarks = {};
};

class ChainElimination {
 public:
  explicit ChainElimination(VectorWidth width = WidestVectors())
      : width_(width) {}

  // Begins a chain. Use Record::kSteps if steps will be requested later.
  enum class Record { kNothing, kSteps };
  void Start(const ChainShape& shape, Record record = Record::kNothing);

  // Takes over the memory of `finished`, after its Finish(), that it would need
  // only for its next chain: its recorded steps stay valid.
  void TakeScratch(ChainElimination* finished);

  using PoseRotation = Eigen::Matrix<double, kChainPoseSize, 3>;

  // First, in any order: the factors of one keyframe and camera, as rows of
  // landmark_rows.h; `observations` are indices into track_keyframes. The
  // matrix is B of these rows; null: [1; 0].
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
  // Ties the state of the keyframe to 15 kept unknowns x: its offset from them
  // has the given information, which must be positive.
  void AddKeptState(int kept, const ChainStateVector& information);
  void Advance(const ChainTransition& link);
  void Finish(SharedInformation* result);

  // After Finish(), with Record::kSteps: the minimising steps for a given step
  // of the shared parameters. 15 for each keyframe, 3 for each landmark.
  void FindSteps(const Eigen::VectorXd& shared,
                 std::vector<ChainStateVector>* states,
                 std::vector<Eigen::Vector3d>* landmarks) const;

  // The same back-substitution for covariances; `states` as FindSteps gives
  // them for the step of the shared parameters.
  void FindPosterior(const Eigen::VectorXd& shared,
                     const Eigen::MatrixXd& shared_covariance,
                     const std::vector<ChainStateVector>& states,
                     ChainPosterior* posterior) const;

  // Link parameters, landmark parameters and kept unknowns.
  int shared_size() const {
    return kChainLinkShared + landmark_shared_ + kept_;
  }

 private:
  class CovarianceWalk;

  void LayOut(const ChainShape& shape);
  void FindViews(const ChainShape& shape);
  void ExpandGram(int keyframe, int camera, const PoseRotation* by_rotation);
  void CollectPoses(int count);
  void SpreadPoses(int count, const PoseRotation& by_rotation);
  void BeginKeyframe();
  void OpenSlots(int slots);
  void EliminateLandmarks();
  double* PoseRow(int landmark, int row);
  int PosesOf(int landmark) const;
  Eigen::Matrix3d PreparePanel(int landmark, double* panel, int stride);
  void RecordPanel(int landmark, const double* panel, int stride);
  void SetRoot(int landmark, Eigen::Matrix3d information);
  void KeepLandmark(int landmark,
                    const Eigen::Matrix3d& information,
                    double* panel,
                    int stride);
  void SwapPoses(int slot);
  void TakeState();
  void Substitute(const ChainTransition& link);
  void FindRoot(double (*M)[16], double (*panel)[16]);
  void FindRootOf(const ChainTransition& link);
  void Eliminate(const std::vector<double>& terms);
  void AddPosesWithFixed(const ChainTransition& link);
  void EliminateByItself();
  void ReserveSteps();
  void RecordStep(const ChainTransition* link);
  Eigen::VectorXd SharedInPlaces(const Eigen::VectorXd& shared) const;
  void PlaceStates(int keyframe,
                   const std::vector<ChainStateVector>& states,
                   Eigen::VectorXd* z) const;

  double* Row(std::vector<double>* panel, int k) const {
    return panel->data() + k * panel_stride_;
  }
  double& Front(int i, int j) {
    return front_[static_cast<std::size_t>(j) * front_stride_ + i];
  }
  Target FrontAt(int i, int j) { return {&Front(i, j), front_stride_}; }
  int Pose(int slot) const {
    return fixed_ + (first_place_ + slot) * kChainPoseSize;
  }
  int PosesSize() const { return slots_ * kChainPoseSize; }
  // Place of a shared parameter in the front.
  int Place(int shared) const;

  template <typename Function>
  void WithKernels(const Function& function) const {
    WithLanes(width_, [&]<int W>() { function(DenseLanes<W>()); });
  }

  VectorWidth width_;
  ChainStructure structure_;
  Record record_ = Record::kNothing;

  // Layout. The front begins with fixed_ places for everything but poses: link
  // parameters, motion, kept unknowns, landmark parameters, the constant,
  // padded to whole vectors.
  std::vector<int> camera_sizes_, camera_offsets_;
  int landmark_shared_ = 0;
  int kept_ = 0;
  int landmark_place_ = 0;
  int constant_ = 0;
  int fixed_ = 0;

  // For each landmark: for each camera 3 rows of sums; 3 rows over the poses
  // that observe it; the Cholesky factor of its information, with inverse
  // diagonal. After its elimination, if steps are recorded, the rows over poses
  // are those of its panel, and the first 3 rows of the sums those over
  // landmark parameters and constant.
  std::vector<double> sums_, pose_rows_, landmark_priors_, roots_;
  std::vector<int> kept_landmarks_;  // -1: eliminated
  std::vector<int> sums_offsets_;
  int sums_size_ = 0;
  std::vector<int> landmark_of_observation_;
  std::size_t landmarks_count_ = 0;
  // The poses that observe landmark m, by time, from views_begin_[m] on; and
  // for each observation the index of its pose among all of these.
  struct View {
    int keyframe;
    int slot;  // at the elimination of the landmark
  };
  std::vector<View> views_;
  std::vector<int> views_begin_;
  std::vector<int> view_of_observation_;
  // Panels of the landmarks that are eliminated together, 3 rows each over the
  // front from the landmark parameters on.
  std::vector<double> group_panels_;
  std::vector<LandmarkTarget> targets_;
  struct PosePanel {
    double* data;
    int stride;
  };
  std::vector<PosePanel> panels_of_poses_;
  std::vector<double> own_poses_;
  std::vector<int> depths_;
  std::vector<double> gram_;
  // Sums of each keyframe: 6 rows over its pose, landmark parameters and
  // constant.
  std::vector<double> keyframe_sums_;
  int keyframe_stride_ = 0;
  // Sums over landmark parameters and constant, lower triangle by columns.
  std::vector<double> shared_sums_;

  // The front, lower triangle by columns, with room for `places_` poses.
  std::vector<double> front_;
  int front_stride_ = 0;
  int places_ = 0;
  int first_place_ = 0;  // of slot 0
  int slots_ = 0;
  int current_ = 0;
  bool begun_ = false;

  // The state that is being eliminated: its information S; panels of 15 rows
  // over the front: coupling Y, Z = Y + S G, P = root^T Z; and Y + S G / 2. One
  // additional zero makes tiles whole.
  Eigen::Matrix<double, 16, 16> information_ =
      Eigen::Matrix<double, 16, 16>::Zero();
  alignas(64) double root_[kChainStateSize][16] = {};  // A L^-T
  alignas(64) double root_transposed_[kChainStateSize][16] = {};
  double factor_[kChainStateSize][16] = {};  // L^T, the upper triangle
  int panel_stride_ = 0;
  std::vector<double> coupling_, substituted_, product_, half_, link_terms_;

  struct Step {
    std::size_t product;  // of its P in products_
    int stride;
    double root[kChainStateSize][16];
    double factor[kChainStateSize][16];
    bool linked;
    ChainTransition link;
  };
  std::vector<Step> steps_;
  std::vector<double> products_;
};

}  // namespace selfcal
