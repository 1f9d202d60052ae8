// A whole calibration problem, linearised at one estimate and eliminated down
// to theta; and the way back from a step of theta to the steps of all else.
// Deterministic.
//
// Keyframes that IMU samples connect form a chain, eliminated by
// ChainElimination. What connects chains is kept by them: landmarks that
// several of them see, and for each gap over which biases walk their value in
// the middle of the walk, so that each end is tied to it by half of the
// variance. Together with theta these make a small dense system, the interface.
// A landmark whose track has pieces that lie far apart in one chain is kept as
// well, since all keyframes between two pieces would be in the front else.
//
// Minimised is
//   F(d) = sum |r + J d|^2 over all factors + the priors
// over the steps d of the keyframes (15 each), of the landmarks and of theta's
// tangent. Theta has no prior in here: the caller adds his to Lambda, chooses
// its step, within a subspace or shortened, and asks for the rest.
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

// Keyframes [begin, end) of a problem that inertial links connect.
struct KeyframeChain {
  int begin = 0;
  int end = 0;
};

std::vector<KeyframeChain> FindChains(const CalibrationProblem& problem);

// What is left unknown of a linear system once all factors have spoken, kind by
// kind: squares of whitened residuals at the minimum, and how much of each the
// unknowns absorb, the trace of its hat matrix.
struct LinearPosterior {
  using Vector6 = Eigen::Matrix<double, 6, 1>;

  // Of each inertial link: its whitened residual, and the covariance of that.
  std::vector<ChainStateVector> inertial;
  std::vector<ChainStateMatrix> inertial_covariance;
  // Summed over bias links, by component. The redundancy is the number of links
  // less what is absorbed.
  Vector6 walk_squares, walk_redundancy;
  int walk_rows = 0;  // each walk is two, by an unknown in its middle
  double prior_squares = 0, prior_absorbed = 0;  // weak priors and gauge
  // Reprojections, and the weak prior of each landmark.
  double pixel_squares = 0;
  // Each observation counts with the weight w that screening gave it, not with
  // that of the loss: sum w, and sum w^2 / sum w, by which what is absorbed
  // counts; the latter of each landmark too, summed.
  double weighted_observations = 0;
  double weight_of_absorbed = 0, landmark_weights = 0;
  int observations = 0;
  int landmarks = 0;
  int unknowns = 0;  // all but theta
};

class LinearSystem {
 public:
  explicit LinearSystem(VectorWidth width = WidestVectors())
      : reprojection_(width), inertial_(width), width_(width) {}

  // Linearises all factors, whitened, and the gauge at the estimate, and
  // eliminates. With a loss, residuals are weighted as in iteratively
  // reweighted least squares: for the Huber loss on normal residuals, the
  // inverse of Lambda is then the covariance of the estimate to 1 %. Without
  // (null), all count fully. The weak priors of the score keep states proper
  // that nothing determines; centred at the estimate, they move nothing.
  // Damping makes these priors stronger, to steps that are small: for a step,
  // not for what is said about theta. 1 is next to nothing where states are
  // determined.
  // Landmarks that do not have two observations left to stand on are left out.
  // What was linearised before is forgotten, its memory kept.
  void Linearise(const Rig& rig,
                 const Calibration& theta,
                 const CalibrationProblem& problem,
                 const std::vector<KeyframeState>& keyframes,
                 const KeyframeMotions& motions,
                 const std::vector<ScreenedLandmark>& landmarks,
                 std::span<const InertialNoiseRoot> roots,
                 const RobustLoss* loss,
                 double damping = 0);

  // Of theta's tangent. Not finite where the factors are not.
  const SharedInformation& information() const { return information_; }

  // Frees the memory that steps and posterior need: until the next
  // linearisation only the information remains.
  void ReleaseChains();

  // What the best steps of keyframes and landmarks take off F while theta
  // stays; with a step s of it, F falls by
  //   decrease + 2 eta^T s - s^T Lambda s.
  double decrease() const { return decrease_; }

  // The steps that minimise F for a step of theta: of the keyframes, and of the
  // landmarks by (alpha, beta, rho), zero for those that were left out.
  void FindSteps(const Eigen::VectorXd& theta_step,
                 std::vector<ChainStateVector>* keyframes,
                 std::vector<Eigen::Vector3d>* landmarks) const;

  // For a step of theta of the given covariance. `landmarks` as they were
  // linearised.
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
    // Of each landmark, the first of its kept unknowns, or -1; and of all kept
    // unknowns their place in the interface.
    std::vector<int> kept_landmarks;
    std::vector<int> interface;
    // The walks into its first and out of its last keyframe: the bias link, or
    // -1, and its first kept unknown.
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
    double share = 1;   // what screening leaves of it
    double weight = 0;  // of its rows; 0: it says nothing
    double square = 0;  // of its rows
    int factor = -1;    // index into the tracks of its chain
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
  // Of a landmark, by p_G: H and g of x^T H x + 2 g^T x.
  struct LandmarkPrior {
    Eigen::Matrix3d H;
    Eigen::Vector3d g;
  };
  LandmarkPrior PriorOf(const std::vector<ScreenedLandmark>& landmarks,
                        int landmark) const;
  void AddLandmarkPriors(const std::vector<ScreenedLandmark>& landmarks,
                         Chain* chain);
  void EliminateKeyframes(Chain* chain);
  // The observations of a view that `keep` wants, as arrays.
  template <typename Keep>
  ObservationRun Gather(int view, const Keep& keep);

  ReprojectionBatch reprojection_;
  InertialBatch inertial_;
  VectorWidth width_;
  std::vector<Chain> chains_;
  SharedInformation information_, of_chain_;
  double decrease_ = 0;
  double motion_squares_ = 0;  // of inertial factors and walks

  // Of the estimate at hand.
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
  // The interface: of each landmark its first unknown, or -1; its information
  // with theta, and its root.
  std::vector<int> interface_of_landmark_;
  int interface_size_ = 0;
  Eigen::MatrixXd interface_, interface_theta_;
  Eigen::VectorXd interface_eta_;
  Eigen::LLT<Eigen::MatrixXd> interface_root_;
  // Of one view.
  std::vector<std::int32_t> landmarks_of_view_;
  std::vector<int> seen_of_view_, factors_;
  std::vector<double> z_px_, squares_px2_, weights_, rows_;
};

}  // namespace selfcal
