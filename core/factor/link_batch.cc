#include "core/factor/link_batch.h"

#include <Eigen/QR>

#include "core/factor/imu_delay.h"
#include "core/factor/inertial_terms.h"
#include "core/factor/inertial_transition.h"
#include "core/model/second_imu.h"

namespace selfcal {
namespace {

using RowMajor =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using ConstRows = Eigen::Map<const RowMajor>;

constexpr int kPose = kChainPoseSize;
constexpr int kMotion = kChainMotionSize;
constexpr int kOne = kChainStateSize;  // size of the state of one IMU

struct Rows {
  ConstRows G, A;
};

Rows RowsOf(const ChainTransition& link) {
  return {ConstRows(link.G, kOne, link.columns.stride),
          ConstRows(link.A, kOne, link.noise())};
}

// Places of the parts of z.
struct Places {
  explicit Places(const TransitionColumns& first,
                  const TransitionColumns& second)
      : link1(first.link_size),
        mount(link1 + second.link_size),
        delay(mount + kMountPoseSize),
        all(mount + kMountTangentSize, 2 * kMotion) {}

  int link1;
  int mount;
  int delay;
  TransitionColumns all;
};

// The change of the state y0, as far as it moves, that compensates a change of
// the measured motion (MotionByDelay).
Eigen::Matrix<double, 9, 1> OfMeasured(
    const InertialLinkStates& link,
    double gravity_mps2,
    const Eigen::Matrix<double, 9, 1>& measured) {
  const KeyframeState& y0 = *link.x0;
  const double dt_s = 1e-9 * static_cast<double>(link.x1->t_ns - y0.t_ns);
  const StateMotion<double> motion =
      MotionBetween(y0, *link.x1, dt_s, gravity_mps2);
  const InertialResidual none = InertialResidual::Zero();
  return inertial::TransitionSolver<double>(
             y0.q_GI.toRotationMatrix(), motion, dt_s, none)
      .OfMeasured(measured);
}

// G z of the first IMU, whose parameters come first.
RowMajor OfFirst(const ConstRows& G,
                 const TransitionColumns& from,
                 const Places& to) {
  RowMajor rows = RowMajor::Zero(G.rows(), to.all.stride);
  rows.leftCols(from.link_size) = G.leftCols(from.link_size);
  rows.middleCols<kMotion>(to.all.link_size) =
      G.middleCols<kMotion>(from.link_size);
  rows.col(to.all.constant) = G.col(from.constant);
  rows.middleCols<kPose>(to.all.next_pose) =
      G.middleCols<kPose>(from.next_pose);
  return rows;
}

// The same of the second one, whose next pose depends on that of the keyframe
// and on its mount, and whose motion depends on its time offset.
RowMajor OfSecond(const ConstRows& G,
                  const TransitionColumns& from,
                  const MountDerivatives& next,
                  const Eigen::Matrix<double, 9, 1>& by_delay,
                  const Places& to) {
  RowMajor rows = RowMajor::Zero(G.rows(), to.all.stride);
  rows.middleCols(to.link1, from.link_size) = G.leftCols(from.link_size);
  rows.middleCols<kMotion>(to.all.link_size + kMotion) =
      G.middleCols<kMotion>(from.link_size);
  rows.col(to.all.constant) = G.col(from.constant);
  const auto by_pose = G.middleCols<kPose>(from.next_pose);
  rows.middleCols<kPose>(to.all.next_pose) = by_pose * next.by_pose;
  rows.middleCols<kMountPoseSize>(to.mount) = by_pose * next.by_mount;
  rows.col(to.delay).head<9>() = by_delay;
  return rows;
}

}  // namespace

ChainTransition LinkTransitions::operator[](std::size_t i) const {
  if (imus_ == 1) return of_imu_[0][i];
  const Joined& link = joined_[i];
  return {
      columns_, link.G.data(), link.A.data(), kMaxChainLinkRows, link.H.data()};
}

ChainNoiseVector LinkTransitions::NoiseOfImus(
    std::size_t i, const ChainNoiseVector& noise) const {
  if (imus_ == 1) return noise;
  return joined_[i].Q * noise;
}

ChainNoiseMatrix LinkTransitions::CovarianceOfImus(
    std::size_t i, const ChainNoiseMatrix& covariance) const {
  if (imus_ == 1) return covariance;
  return joined_[i].Q * covariance * joined_[i].Q.transpose();
}

std::span<const InertialLinkStates> LinkBatch::InFrame(
    std::span<const InertialLinkStates> links,
    const Calibration& theta,
    int imu) {
  if (imu == 0) return links;
  states_.clear();
  states_.reserve(2 * links.size());
  moved_.clear();
  for (const InertialLinkStates& link : links) {
    states_.push_back(StateOfImu(theta, imu, *link.x0));
    states_.push_back(StateOfImu(theta, imu, *link.x1));
    moved_.push_back(
        {&states_[states_.size() - 2], &states_.back(), link.samples});
  }
  return moved_;
}

template <class Function>
void LinkBatch::ForEachImu(const LinksOfImus& links,
                           const Calibration& theta,
                           double gravity_mps2,
                           LinkTransitions* out,
                           const Function& linearise) {
  out->imus_ = ImuCount(theta);
  linearise(links[0], 0);
  out->joined_.clear();
  if (out->imus_ == 1) return;
  const std::span<const InertialLinkStates> second_links =
      InFrame(links[1], theta, 1);
  linearise(second_links, 1);
  const SecondImuCalibration& mount = *theta.imu1;
  for (std::size_t i = 0; i < out->size(); ++i) {
    const ChainTransition first = out->of_imu_[0][i];
    const ChainTransition second = out->of_imu_[1][i];
    const Places places(first.columns, second.columns);
    out->columns_ = places.all;
    const MountDerivatives at = DerivativesOfMount(mount, *links[0][i].x0);
    const Rows x = RowsOf(first), y = RowsOf(second);
    LinkTransitions::Joined& joined = out->joined_.emplace_back(places.all);
    const InertialLinkStates& link = second_links[i];
    const RowMajor D_y = OfSecond(
        y.G,
        second.columns,
        DerivativesOfMount(mount, *links[0][i].x1),
        OfMeasured(link,
                   gravity_mps2,
                   MotionByDelay(link.samples, *link.x0, *link.x1, mount)),
        places);
    joined.G.topRows<kOne>() = OfFirst(x.G, first.columns, places);
    joined.G.bottomRows<kMotion>() = D_y.bottomRows<kMotion>();
    // C and D, of the pose of y.
    Eigen::Matrix<double, kPose, 2 * kOne> C;
    C << at.by_pose * x.A.topLeftCorner<kPose, kOne>(),
        -y.A.topLeftCorner<kPose, kOne>();
    RowMajor D = at.by_pose * joined.G.topRows<kPose>();
    D.middleCols<kMountPoseSize>(places.mount) += at.by_mount;
    D -= D_y.topRows<kPose>();

    const Eigen::HouseholderQR<Eigen::Matrix<double, 2 * kOne, kPose>> qr(
        C.transpose());
    const Eigen::Matrix<double, 2 * kOne, 2 * kOne> Q = qr.householderQ();
    const auto Q1 = Q.leftCols<kPose>();
    joined.Q << Q.rightCols<kMaxChainStateSize>(), Q1;
    joined.H = -qr.matrixQR()
                    .topRows<kPose>()
                    .triangularView<Eigen::Upper>()
                    .transpose()
                    .solve(D);
    Eigen::Matrix<double, kMaxChainStateSize, 2 * kOne> B;
    B.setZero();
    B.topLeftCorner<kOne, kOne>() = x.A.leftCols<kOne>();
    B.bottomRightCorner<kMotion, kOne>() =
        y.A.bottomLeftCorner<kMotion, kOne>();
    joined.A = B * Q.rightCols<kMaxChainStateSize>();
    joined.G += B * Q1 * joined.H;
  }
}

void LinkBatch::Linearise(const LinksOfImus& links,
                          const Calibration& theta,
                          const Rig& rig,
                          LinkTransitions* out) {
  ForEachImu(links,
             theta,
             rig.gravity_mps2,
             out,
             [&](std::span<const InertialLinkStates> of_imu, int imu) {
               std::vector<InertialNoiseRoot>& roots = roots_[imu];
               if (roots.size() < of_imu.size()) roots.resize(of_imu.size());
               inertial_.Linearise(of_imu,
                                   ImuOf(theta, imu),
                                   NoiseOfImu(rig, imu),
                                   rig.gravity_mps2,
                                   std::span(roots).first(of_imu.size()),
                                   &out->of_imu_[imu]);
             });
}

void LinkBatch::LineariseWithRoots(const LinksOfImus& links,
                                   const Calibration& theta,
                                   double gravity_mps2,
                                   const RootsOfImus& roots,
                                   LinkTransitions* out) {
  ForEachImu(links,
             theta,
             gravity_mps2,
             out,
             [&](std::span<const InertialLinkStates> of_imu, int imu) {
               inertial_.LineariseWithRoots(of_imu,
                                            ImuOf(theta, imu),
                                            gravity_mps2,
                                            roots[imu],
                                            &out->of_imu_[imu]);
             });
}

void LinkBatch::Residuals(std::span<const InertialLinkStates> links,
                          const Calibration& theta,
                          int imu,
                          double gravity_mps2,
                          std::span<const InertialNoiseRoot> roots,
                          std::span<InertialResidual> whitened) {
  inertial_.Residuals(InFrame(links, theta, imu),
                      ImuOf(theta, imu),
                      gravity_mps2,
                      roots,
                      whitened);
}

}  // namespace selfcal
