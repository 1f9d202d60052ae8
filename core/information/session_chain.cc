#include "core/information/session_chain.h"

#include <Eigen/Cholesky>

#include "core/factor/inertial.h"
#include "core/information/linearisation.h"
#include "core/model/temperature.h"

namespace selfcal {
namespace {

constexpr int kState = kStateTangentSize;

// Information of a segment about theta [-] point and its ends.
ThetaInformation About(const Calibration& point, const SegmentEnds& segment) {
  const Eigen::VectorXd b = BoxMinus(point, segment.theta0);
  const auto D = b.size();
  Eigen::MatrixXd M =
      Eigen::MatrixXd::Identity(segment.eta.size(), segment.eta.size());
  M.topLeftCorner(D, D) = ThetaByOffset(segment.theta0, b).inverse();
  return {M.transpose() * segment.Lambda * M,
          M.transpose() * (segment.eta - segment.Lambda.leftCols(D) * b)};
}

// Lambda and eta after elimination of the unknowns [begin, begin + count).
ThetaInformation Eliminated(const Eigen::MatrixXd& Lambda,
                            const Eigen::VectorXd& eta,
                            int begin,
                            int count) {
  std::vector<int> rest, gone;
  for (int i = 0; i < static_cast<int>(eta.size()); ++i) {
    (i >= begin && i < begin + count ? gone : rest).push_back(i);
  }
  // Scaled to a unit diagonal: the units of states differ by orders of
  // magnitude.
  const Eigen::VectorXd scale =
      Lambda.diagonal()(gone).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd inner =
      scale.asDiagonal() * Lambda(gone, gone) * scale.asDiagonal();
  const Eigen::MatrixXd coupling = scale.asDiagonal() * Lambda(gone, rest);
  const Eigen::LDLT<Eigen::MatrixXd> solver(inner);
  Eigen::MatrixXd remaining =
      Lambda(rest, rest) - coupling.transpose() * solver.solve(coupling);
  return {0.5 * (remaining + remaining.transpose()),
          eta(rest) - coupling.transpose() *
                          solver.solve(scale.cwiseProduct(eta(gone)).eval())};
}

}  // namespace

SessionChain::SessionChain(const Rig& rig, const Calibration& point)
    : rig_(rig),
      point_(point),
      theta_(TangentSize(point)),
      Lambda_(Eigen::MatrixXd::Zero(theta_, theta_)),
      eta_(Eigen::VectorXd::Zero(theta_)) {}

void SessionChain::Add(const SegmentEnds& segment, double weight) {
  const bool same_session = end_ && end_->key.session == segment.key.session;
  if (end_ && !same_session) Eliminate(theta_, kState);
  // Over theta, the newest state if the session continues, and both ends.
  const int before = same_session ? kState : 0;
  const int size = theta_ + before + 2 * kState;
  const int first = theta_ + before;
  const ThetaInformation added = About(point_, segment);
  std::vector<int> places;
  for (int i = 0; i < theta_; ++i) places.push_back(i);
  for (int i = first; i < size; ++i) places.push_back(i);
  Lambda_.conservativeResizeLike(Eigen::MatrixXd::Zero(size, size));
  eta_.conservativeResizeLike(Eigen::VectorXd::Zero(size));
  Lambda_(places, places) += weight * added.Lambda;
  eta_(places) += weight * added.eta;

  const bool follows =
      same_session && segment.key.index == end_->key.index + 1 &&
      end_->state.t_ns < segment.first.t_ns && !end_->tail.empty() &&
      end_->tail.front().t_ns <= end_->state.t_ns &&
      end_->tail.back().t_ns >= segment.first.t_ns;
  if (follows) {
    AddLink(segment);
  } else {
    Lambda_.block<kState, kState>(first, first) +=
        MotionPrior() + GaugePrior(segment.first);
    if (same_session) AddGap(segment);
  }
  Eliminate(theta_, before + kState);
  end_ = {segment.key, segment.temperature_c, segment.last, segment.tail};
}

// The inertial factor from the newest keyframe to the first of the segment.
void SessionChain::AddLink(const SegmentEnds& segment) {
  // The temperature of the link is the mean of both segments.
  const double temperature_c =
      0.5 * (end_->temperature_c + segment.temperature_c);
  const SegmentTheta theta_s(point_, temperature_c);
  InertialJacobians J;
  InertialMatrix covariance;
  const InertialResidual residual = EvaluateInertial(end_->tail,
                                                     end_->state,
                                                     segment.first,
                                                     theta_s->imu,
                                                     rig_.imu_noise,
                                                     rig_.gravity_mps2,
                                                     &J,
                                                     &covariance);
  const InertialMatrix W = SquareRootInformation(covariance);
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(kState, eta_.size());
  Eigen::MatrixXd by_theta = J.theta;
  if (theta_s.varies()) {
    by_theta *=
        TemperatureDerivative(point_, temperature_c).topRows(J.theta.cols());
  }
  for (const int i : FreeComponents(rig_)) {
    if (i < by_theta.cols()) rows.col(i) = by_theta.col(i);
  }
  rows.middleCols<kState>(theta_) = J.x0;
  rows.middleCols<kState>(theta_ + kState) = J.x1;
  rows = W * rows;
  Lambda_ += rows.transpose() * rows;
  eta_ -= rows.transpose() * (W * residual);
}

// The biases walk from the newest keyframe to the first of the segment.
void SessionChain::AddGap(const SegmentEnds& segment) {
  const double dt_s =
      static_cast<double>(segment.first.t_ns - end_->state.t_ns) * 1e-9;
  if (!(dt_s > 0)) return;
  const Eigen::Matrix<double, 6, 1> information =
      BiasWalkSigmas(rig_.imu_noise, dt_s).cwiseAbs2().cwiseInverse();
  Eigen::Matrix<double, 6, 1> residual;
  residual << segment.first.b_a - end_->state.b_a,
      segment.first.b_g - end_->state.b_g;
  for (int m = 0; m < 6; ++m) {
    const int from = theta_ + kStateAccelBias + m;
    const int to = from + kState;
    Lambda_(from, from) += information[m];
    Lambda_(to, to) += information[m];
    Lambda_(from, to) -= information[m];
    Lambda_(to, from) -= information[m];
    eta_(from) += information[m] * residual[m];
    eta_(to) -= information[m] * residual[m];
  }
}

void SessionChain::Eliminate(int begin, int count) {
  ThetaInformation rest = Eliminated(Lambda_, eta_, begin, count);
  Lambda_ = std::move(rest.Lambda);
  eta_ = std::move(rest.eta);
}

// Let w be the walk: theta + w is the quantity of interest from now on. Its
// information is what remains after w, with its variances as a prior, is
// eliminated.
void SessionChain::Age(const Eigen::VectorXd& variances) {
  std::vector<int> walking;
  for (int i = 0; i < theta_; ++i) {
    if (variances(i) > 0) walking.push_back(i);
  }
  if (walking.empty()) return;
  const Eigen::VectorXd sigma = variances(walking).cwiseSqrt();
  const Eigen::MatrixXd by_walk =
      sigma.asDiagonal() * Lambda_(walking, Eigen::all);
  Eigen::MatrixXd inner =
      sigma.asDiagonal() * Lambda_(walking, walking) * sigma.asDiagonal();
  inner.diagonal().array() += 1;
  const Eigen::LLT<Eigen::MatrixXd> solver(inner);
  eta_ -= by_walk.transpose() *
          solver.solve(sigma.cwiseProduct(eta_(walking)).eval());
  Lambda_ -= by_walk.transpose() * solver.solve(by_walk);
}

ThetaInformation SessionChain::Theta() const {
  if (!end_) return {Lambda_, eta_};
  return Eliminated(Lambda_, eta_, theta_, kState);
}

}  // namespace selfcal
