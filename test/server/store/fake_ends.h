// Ends of a segment that was never recorded: numbers out of a generator.
#pragma once

#include <random>

#include "core/information/segment_ends.h"
#include "core/model/rig.h"

namespace selfcal::server {

inline SegmentEnds FakeEnds(const Rig& rig, const SegmentKey& key) {
  std::mt19937 random(static_cast<unsigned>(key.index) + 1);
  std::normal_distribution<double> normal;
  const auto draw = [&](auto) { return normal(random); };
  const int size = TangentSize(rig.factory) + kEndUnknowns;
  const Eigen::MatrixXd root =
      Eigen::MatrixXd::Zero(size, size).unaryExpr(draw);
  SegmentEnds ends;
  ends.key = key;
  ends.theta0 = rig.factory;
  ends.first.t_ns = 1'000 * key.index;
  ends.last.t_ns = ends.first.t_ns + 500;
  ends.last.p_GI = {1.0 / 3, 2, 3};
  ends.last.q_GI = Eigen::Quaterniond(0.5, -0.5, 0.5, 0.5);
  ends.last.b_g = {0.1, 0.2, 0.3};
  // Symmetric to the bit, also where products and sums are contracted.
  const Eigen::MatrixXd product = root * root.transpose();
  ends.Lambda = product.selfadjointView<Eigen::Lower>();
  ends.eta = Eigen::VectorXd::Zero(size).unaryExpr(draw);
  ends.tail = {{ends.last.t_ns - 5, {1, 2, 3}, {4, 5, 6}},
               {ends.last.t_ns + 5, {7, 8, 9}, {1, 1, 0.1}}};
  return ends;
}

}  // namespace selfcal::server
