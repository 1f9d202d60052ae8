#include "test/evaluation/information_gain.h"

#include <Eigen/QR>
#include <cmath>

#include "core/model/symmetric_eigen.h"

namespace selfcal {

TruncatedQr TruncateRoot(const Eigen::MatrixXd& root, double truncation) {
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(root);
  TruncatedQr result;
  const Eigen::VectorXd pivots = qr.matrixQR().diagonal().cwiseAbs();
  // Pivots fall.
  while (result.rank < pivots.size() && pivots(result.rank) >= truncation) {
    result.half_log_det += std::log(pivots(result.rank));
    ++result.rank;
  }
  return result;
}

TruncatedQr TruncateInformation(const Rig& rig,
                                const Eigen::MatrixXd& Lambda,
                                double truncation) {
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd prior = PriorSigmas(rig);
  const Eigen::MatrixXd normalised =
      (prior.asDiagonal() * Lambda * prior.asDiagonal())(free, free);
  const SymmetricEigen eigen(normalised);
  const Eigen::VectorXd roots = eigen.eigenvalues().cwiseMax(0).cwiseSqrt();
  return TruncateRoot(roots.asDiagonal() * eigen.eigenvectors().transpose(),
                      truncation);
}

GainResult RunInformationGain(const Rig& rig,
                              const std::vector<MotionSegment>& segments,
                              const GainOptions& options,
                              const CalibrateOptions& calibrate) {
  GainResult result;
  TruncatedQr database;
  Calibration theta = rig.factory;
  for (int i = 0; i < static_cast<int>(segments.size()); ++i) {
    SegmentSet set = result.kept;
    set.push_back(i);
    CalibrationResult with =
        Calibrate(rig, theta, Pick(segments, set), calibrate);
    double gain = 0;
    bool rose = false;
    if (with.status == CalibrateStatus::kConverged) {
      const TruncatedQr qr =
          TruncateInformation(rig, with.Lambda, options.truncation);
      rose = qr.rank > database.rank;
      if (qr.rank == database.rank) {
        gain = qr.half_log_det - database.half_log_det;
      }
      if (rose || gain > options.threshold_nats) {
        database = qr;
        theta = with.theta;
        result.kept = std::move(set);
        result.calibration = std::move(with);
      }
    }
    result.gains.push_back(gain);
    result.rank_rose.push_back(rose);
    if (options.stop_at > 0 &&
        static_cast<int>(result.kept.size()) >= options.stop_at) {
      break;
    }
  }
  return result;
}

}  // namespace selfcal
