#include "core/preflight/signed_permutation.h"

#include <algorithm>
#include <cstddef>

namespace selfcal {
namespace {

int ChangedAxes(const Eigen::Matrix3d& m) {
  return static_cast<int>((m.diagonal().array() < 0.5).count());
}

std::array<Eigen::Matrix3d, 48> MakeAll() {
  std::array<Eigen::Matrix3d, 48> all;
  std::size_t count = 0;
  std::array<int, 3> order = {0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      Eigen::Matrix3d& m = all[count++];
      m.setZero();
      for (int i = 0; i < 3; ++i) m(i, order[i]) = signs >> i & 1 ? -1 : 1;
    }
  } while (std::next_permutation(order.begin(), order.end()));
  std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) {
    return ChangedAxes(a) < ChangedAxes(b);
  });
  return all;
}

}  // namespace

const std::array<Eigen::Matrix3d, 48>& SignedPermutations() {
  static const std::array<Eigen::Matrix3d, 48> all = MakeAll();
  return all;
}

std::string AxesText(const Eigen::Matrix3d& true_from_fed) {
  std::string text = "(";
  for (int i = 0; i < 3; ++i) {
    int axis = 0;
    true_from_fed.row(i).cwiseAbs().maxCoeff(&axis);
    if (i > 0) text += ", ";
    if (true_from_fed(i, axis) < 0) text += '-';
    text += "xyz"[axis];
  }
  return text + ")";
}

}  // namespace selfcal
