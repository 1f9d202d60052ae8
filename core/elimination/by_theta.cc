#include "core/elimination/by_theta.h"

namespace selfcal {

SharedInformation ByTheta(const Eigen::MatrixXd& derivative,
                          const SharedInformation& given) {
  const Eigen::Index from = derivative.rows(), to = derivative.cols();
  const Eigen::Index others = given.eta.size() - from;
  SharedInformation result{Eigen::MatrixXd(to + others, to + others),
                           Eigen::VectorXd(to + others),
                           given.constant};
  const Eigen::MatrixXd rows =
      derivative.transpose() * given.Lambda.topRows(from);
  const Eigen::MatrixXd of_theta = rows.leftCols(from) * derivative;
  result.Lambda << 0.5 * (of_theta + of_theta.transpose()),
      rows.rightCols(others), rows.rightCols(others).transpose(),
      given.Lambda.bottomRightCorner(others, others);
  result.eta << derivative.transpose() * given.eta.head(from),
      given.eta.tail(others);
  return result;
}

}  // namespace selfcal
