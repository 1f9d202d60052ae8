// A whole calibration problem, linearised at one estimate and eliminated down
// to theta, with the back-substitution from a step of theta to the steps of all
// other unknowns. Deterministic.
//
// Keyframes that are connected by IMU samples form a chain, eliminated by
// ChainElimination. The unknowns that connect chains are kept: landmarks that
// several of them observe and, for each gap over which biases walk, the biases
// in the middle of the walk, to which each end is tied with half of the
// variance. Together with theta these form a small dense system, the interface.
// A landmark whose track has distant pieces in one chain is kept as well, since
// otherwise all keyframes between two pieces would be in the front.
//
// The system minimises
//   F(d) = sum |r + J d|^2 over all factors + the priors
// over the steps d of the keyframes (15 each), of the landmarks and of theta's
// tangent. It has no prior on theta: the caller adds one to Lambda, chooses the
// step, within a subspace or shortened, and requests the other steps.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <memory>
#include <span>
#include <vector>

#include "core/calibration/problem.h"
#include "core/calibration/robust_loss.h"
#include "core/calibration/screening.h"
#include "core/elimination/chain_elimination.h"
#include "core/factor/inertial_batch.h"
#include "core/factor/keyframe_motion.h"
#include "core/factor/reprojection_batch.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal {

// Keyframes [begin, end) of a problem that are connected by inertial links.
struct KeyframeChain {
  int begin = 0;
  int end = 0;
};

std::vector<KeyframeChain> FindChains(const CalibrationProblem& problem);

// Posterior of a linear system by kind of factor: squares of whitened residuals
// at the minimum, and how much of each the unknowns absorb, which is the trace
// of its hat matrix.
struct LinearPosterior {
  using Vector6 = Eigen::Matrix<double, 6, 1>;

  // Whitened residual of each inertial link, and its covariance.
  std::vector<ChainStateVector> inertial;
  std::vector<ChainStateMatrix> inertial_covariance;
  // Sums over bias links, by component. The redundancy is the number of links
  // minus the absorbed part.
  Vector6 walk_squares, walk_redundancy;
  int walk_rows = 0;  // each walk has two, due to the unknown in its middle
  double prior_squares = 0, prior_absorbed = 0;  // weak priors and gauge
  // Reprojections, and the weak prior of each landmark.
  double pixel_squares = 0;
  // Observations have the weight w from screening, not that of the loss: sum w,
  // and sum w^2 / sum w, the weight of the absorbed part; the latter also for
  // each landmark, summed.
  double weighted_observations = 0;
  double weight_of_absorbed = 0, landmark_weights = 0;
  int observations = 0;
  int landmarks = 0;
  int unknowns = 0;  // all except theta
};

class LinearSystem {
 public:
  explicit LinearSystem(VectorWidth width = WidestVectors())
      : reprojection_(width), inertial_(width), width_(width) {}

  // Linearises and whitens all factors and the gauge at the estimate, and
  // eliminates. With a loss, residuals are weighted as in iteratively
  // reweighted least squares: for the Huber loss on normal residuals, the
  // inverse of Lambda is then the covariance of the estimate to 1 %. Without a
  // loss (null), all have full weight. The weak priors of the score keep
  // undetermined states proper; since they are centred at the estimate, they do
  // not move it. Damping strengthens these priors to the size of small steps;
  // it is for computing a step, not the information about theta. A damping of 1
  // is negligible for states that are determined. Landmarks with fewer than two
  // remaining observations are excluded. The previous linearisation is
  // discarded, its memory is reused.
  void Linearise(const Rig& rig,
                 const Calibration& theta,
                 const CalibrationProblem& problem,
                 const std::vector<KeyframeState>& keyframes,
                 const KeyframeMotions& motions,
                 const std::vector<ScreenedLandmark>& landmarks,
                 std::span<const InertialNoiseRoot> roots,
                 const RobustLoss* loss,
                 double damping = 0);

  // Information about theta's tangent. Not finite if the factors are not.
  const SharedInformation& information() const { return information_; }

  // Frees the memory that steps and posterior need: until the next
  // linearisation only the information remains.
  void ReleaseChains();

  // Decrease of F by the optimal steps of keyframes and landmarks with theta
  // held constant; with a step s of theta, F decreases by
  //   decrease + 2 eta^T s - s^T Lambda s.
  double decrease() const { return decrease_; }

  // Back-substitution: the steps that minimise F for a step of theta, of the
  // keyframes and of the landmarks by (alpha, beta, rho); zero for excluded
  // landmarks.
  void FindSteps(const Eigen::VectorXd& theta_step,
                 std::vector<ChainStateVector>* keyframes,
                 std::vector<Eigen::Vector3d>* landmarks) const;

  // Posterior for a step of theta with the given covariance. `landmarks` as
  // they were linearised.
  LinearPosterior FindPosterior(
      const Eigen::VectorXd& theta_step,
      const Eigen::MatrixXd& theta_covariance,
      const std::vector<ScreenedLandmark>& landmarks) const;

 private:
  static constexpr int kNone = -1;

  struct Chain {
    explicit Chain(VectorWidth width) : elimination(width) {}

    KeyframeChain range;
    ChainElimination elimination;
    std::vector<int> landmarks;  // indices into those of the problem
    std::vector<int> tracks, track_keyframes;
    // The first kept unknown of each landmark, or -1; and the index in the
    // interface of all kept unknowns.
    std::vector<int> kept_landmarks;
    std::vector<int> interface;
    // The walks into the first keyframe of the chain and out of its last: the
    // bias link, or -1, and its first kept unknown.
    struct Walk {
      int link = kNone;
      int kept = 0;
      KeptBiasRows rows;
    };
    Walk walk_in, walk_out;
  };
  // An observation that is used.
  struct Seen {
    int view;  // keyframe and camera
    int landmark;
    int piece;  // of its track
    Eigen::Vector2d z_px;
    double share = 1;   // weight from screening
    double weight = 0;  // of its rows; 0: no information
    double square = 0;  // of its rows
    int factor = -1;    // index into the observations of its chain
  };

  void StartChains(const CalibrationProblem& problem,
                   int cameras,
                   double damping);
  void AddPiece(int landmark, std::span<Seen> seen, Chain* chain);
  int KeepInChain(int place, int size, Chain* chain);
  void KeepWalks(const CalibrationProblem& problem);
  Eigen::VectorXd InterfaceStep(const Eigen::VectorXd& theta_step) const;
  Eigen::MatrixXd SharedCovariance(
      const Eigen::MatrixXd& theta_covariance) const;
  void AddWalk(const Chain::Walk& walk,
               const ChainStateVector& step,
               const ChainStateMatrix& covariance,
               const Eigen::MatrixXd& with_shared,
               const Eigen::VectorXd& shared_step,
               const Eigen::MatrixXd& shared_covariance,
               LinearPosterior* posterior) const;
  void AddLandmarks(const std::vector<ScreenedLandmark>& landmarks,
                    LinearPosterior* posterior) const;
  void AddChain(const Chain& chain);
  void SolveInterface(const std::vector<ScreenedLandmark>& landmarks);
  void PlaceLandmarks(const std::vector<ScreenedLandmark>& landmarks);
  void SortByView(const CalibrationProblem& problem,
                  const std::vector<ScreenedLandmark>& landmarks);
  void Weigh(const RobustLoss* loss);
  void FindTracks();
  void AddViews(Chain* chain);
  // Prior of a landmark with respect to p_G: H and g of x^T H x + 2 g^T x.
  struct LandmarkPrior {
    Eigen::Matrix3d H;
    Eigen::Vector3d g;
  };
  LandmarkPrior PriorOf(const std::vector<ScreenedLandmark>& landmarks,
                        int landmark) const;
  void AddLandmarkPriors(const std::vector<ScreenedLandmark>& landmarks,
                         Chain* chain);
  void EliminateKeyframes(Chain* chain);
  // Gathers the observations of a view that `keep` selects, as arrays.
  template <typename Keep>
  ObservationRun Gather(int view, const Keep& keep);

  ReprojectionBatch reprojection_;
  InertialBatch inertial_;
  VectorWidth width_;
  std::vector<Chain> chains_;
  SharedInformation information_, of_chain_;
  double decrease_ = 0;
  double motion_squares_ = 0;  // of inertial factors and walks

  // The current estimate.
  const Rig* rig_ = nullptr;
  const Calibration* theta_ = nullptr;
  const std::vector<KeyframeState>* keyframes_ = nullptr;
  const KeyframeMotions* motions_ = nullptr;
  std::vector<int> camera_sizes_;
  std::vector<ChainStateMatrix> priors_;
  std::vector<bool> has_prior_;

  std::vector<double> points_;  // homogeneous, 4 for each landmark
  std::vector<LandmarkPlace> places_;
  std::vector<Seen> seen_;  // by landmark
  std::vector<int> seen_begin_;
  std::vector<int> by_view_, view_begin_;
  std::vector<int> chain_of_keyframe_;
  std::vector<InertialLinkStates> links_;
  std::vector<InertialTransition> transitions_;
  std::vector<int> inertial_after_;  // link to the next, or -1
  // The interface: for each landmark its first unknown, or -1; the information,
  // its coupling with theta, and its root.
  std::vector<int> interface_of_landmark_;
  int interface_size_ = 0;
  Eigen::MatrixXd interface_, interface_theta_;
  Eigen::VectorXd interface_eta_;
  Eigen::LLT<Eigen::MatrixXd> interface_root_;
  // Buffers for one view.
  std::vector<std::int32_t> landmarks_of_view_;
  std::vector<int> seen_of_view_, factors_;
  std::vector<double> z_px_, squares_px2_, weights_, rows_;
};

}  // namespace selfcal
