#include "test/core/elimination/random_chain.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/elimination/landmark_rows.h"

namespace selfcal {
namespace {

template <typename Matrix>
void FillNormal(std::mt19937* random, Matrix* matrix) {
  std::normal_distribution<double> normal;
  for (Eigen::Index j = 0; j < matrix->cols(); ++j) {
    for (Eigen::Index i = 0; i < matrix->rows(); ++i) {
      (*matrix)(i, j) = normal(*random);
    }
  }
}

// Links as those of a motion: neither growing nor shrinking along the chain.
Eigen::MatrixXd NearRotation(int size, std::mt19937* random) {
  Eigen::MatrixXd A(size, size);
  FillNormal(random, &A);
  const Eigen::MatrixXd Q = A.householderQr().householderQ();
  FillNormal(random, &A);
  return 4 * Q + 0.2 * A;
}

ChainObservation RandomObservation(int keyframe,
                                   int camera,
                                   const RandomChainShape& shape,
                                   std::mt19937* random) {
  ChainObservation observation;
  observation.keyframe = keyframe;
  observation.camera = camera;
  observation.own.resize(2, shape.cameras[camera].own());
  FillNormal(random, &observation.residual);
  FillNormal(random, &observation.turn);
  FillNormal(random, &observation.own);
  FillNormal(random, &observation.position);
  return observation;
}

std::vector<ChainObservation> RandomTrack(int first,
                                          const RandomChainShape& shape,
                                          std::mt19937* random) {
  std::uniform_int_distribution<int> length(1, shape.max_track);
  std::bernoulli_distribution seen(shape.seen);
  const int end = std::min(shape.keyframes, first + length(*random));
  std::vector<ChainObservation> track;
  for (int k = first; k < end; ++k) {
    const int cameras = static_cast<int>(shape.cameras.size());
    for (int camera = 0; camera < cameras; ++camera) {
      if ((k == first && camera == 0) || seen(*random)) {
        track.push_back(RandomObservation(k, camera, shape, random));
      }
    }
  }
  if (end < shape.keyframes &&
      std::bernoulli_distribution(shape.found_again)(*random)) {
    std::uniform_int_distribution<int> again(end, shape.keyframes - 1);
    track.push_back(RandomObservation(again(*random), 0, shape, random));
  }
  return track;
}

// Derivative of a factor with respect to the pose.
Eigen::Matrix<double, 2, 6> ByPose(const ChainObservation& observation) {
  Eigen::Matrix<double, 2, 6> J;
  J << observation.turn, observation.position;
  J.leftCols<3>() = (J * observation.by_rotation).eval();
  return J;
}
Eigen::Matrix2Xd ByCamera(const LandmarkRows& rows,
                          const ChainObservation& observation) {
  if (rows.rolling) return observation.own;
  Eigen::Matrix2Xd J(2, 3 + observation.own.cols());
  J << -observation.turn, observation.own;
  return J;
}

// G, A and H in memory.
struct Link {
  using Rows =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  ChainTransition View() const {
    return {columns, G.data(), A.data(), static_cast<int>(H.rows()), H.data()};
  }

  TransitionColumns columns;
  Rows G, A, H;
};

Link Solve(const Chain& chain, const ChainRows& rows) {
  const int size = chain.state_size;
  // Rows of different kinds differ by many orders: equilibrated before LU.
  const Eigen::MatrixXd x0 = rows.x0.topRows(size);
  const Eigen::VectorXd scale =
      x0.rowwise().lpNorm<Eigen::Infinity>().cwiseInverse();
  const Eigen::PartialPivLU<Eigen::MatrixXd> lu(scale.asDiagonal() * x0);
  const auto solve = [&](const auto& columns) {
    return lu.solve(scale.asDiagonal() * columns).eval();
  };
  const int motion = size - kChainPoseSize;
  const TransitionColumns at(static_cast<int>(rows.shared.cols()), motion);
  Link link = {at, {}, {}, {}};
  // The rows over z, with the sign of a side of an equation.
  const auto place = [&](double sign,
                         const Eigen::MatrixXd& shared,
                         const Eigen::MatrixXd& x1,
                         const Eigen::VectorXd& residual,
                         Link::Rows* to) {
    to->setZero(residual.size(), at.stride);
    to->leftCols(at.link_size) = sign * shared;
    to->middleCols(at.link_size, motion) = sign * x1.rightCols(motion);
    to->col(at.constant) = sign * residual;
    to->middleCols<6>(at.next_pose) = sign * x1.leftCols<6>();
  };
  place(-1,
        solve(rows.shared.topRows(size)),
        solve(rows.x1.topRows(size)),
        solve(rows.residual.head(size)),
        &link.G);
  const Eigen::Index further = rows.residual.size() - size;
  place(1,
        rows.shared.bottomRows(further),
        rows.x1.bottomRows(further),
        rows.residual.tail(further),
        &link.H);
  link.A.setZero(size, WholeVectors(size));
  link.A.leftCols(size) = solve(Eigen::MatrixXd::Identity(size, size));
  return link;
}

// The observations of one keyframe and camera, as input of the elimination.
void AddObservations(const Chain& chain,
                     int keyframe,
                     int camera,
                     ChainElimination* elimination) {
  const LandmarkRows& columns = chain.cameras[camera];
  const int stride = columns.stride();
  std::vector<double> rows;
  std::vector<int> indices;
  ChainElimination::PoseRotation by_rotation =
      ChainElimination::PoseRotation::Identity();
  int index = 0;
  for (const auto& track : chain.landmarks) {
    for (const ChainObservation& observation : track) {
      if (observation.keyframe == keyframe && observation.camera == camera) {
        for (int r = 0; r < 2; ++r) {
          Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(stride);
          row.segment<3>(kRowsTurn) = observation.turn.row(r);
          row.segment<3>(kRowsPosition) = observation.position.row(r);
          row.segment(kRowsOwn, columns.own()) = observation.own.row(r);
          row(columns.residual()) = observation.residual(r);
          rows.insert(rows.end(), row.data(), row.data() + stride);
        }
        indices.push_back(index);
        by_rotation = observation.by_rotation;
      }
      ++index;
    }
  }
  rows.resize(rows.size() + 2 * kPanelPad * stride);
  elimination->AddObservations(
      keyframe,
      camera,
      rows.data(),
      indices,
      by_rotation.isIdentity(0) ? nullptr : &by_rotation);
}

// Draws the pose rotation of each keyframe for the cameras of odd number.
void TurnPoses(std::mt19937* random, Chain* chain) {
  for (int k = 0; k < chain->keyframes(); ++k) {
    const auto cameras = static_cast<int>(chain->cameras.size());
    for (int camera = 1; camera < cameras; camera += 2) {
      ChainElimination::PoseRotation by_rotation;
      FillNormal(random, &by_rotation);
      for (auto& track : chain->landmarks) {
        for (ChainObservation& observation : track) {
          if (observation.keyframe == k && observation.camera == camera) {
            observation.by_rotation = by_rotation;
          }
        }
      }
    }
  }
}

}  // namespace

int Chain::shared_size() const {
  return std::accumulate(
      cameras.begin(),
      cameras.end(),
      link_size + kept,
      [](int sum, const LandmarkRows& rows) { return sum + rows.shared; });
}

Chain RandomChain(const RandomChainShape& shape, std::mt19937* random) {
  Chain chain;
  chain.link_size = shape.link_size;
  const int size = chain.state_size = shape.state_size;
  chain.cameras = shape.cameras;
  chain.landmark_prior = 1e-2;
  chain.landmark_prior_slope = {0.01, -0.02, 0.03};
  for (int k = 0; k < shape.keyframes; ++k) {
    chain.priors.push_back(1e-2 * ChainStateMatrix::Identity(size, size));
    if (k + 1 < shape.keyframes) {
      ChainRows link;
      const int rows = size + shape.further_rows;
      link.residual.resize(rows);
      FillNormal(random, &link.residual);
      link.x0.setZero(rows, size);
      link.x0.topRows(size) = NearRotation(size, random);
      link.x1.resize(rows, size);
      FillNormal(random, &link.x1);
      link.x1.topRows(size) = NearRotation(size, random);
      link.shared.resize(rows, shape.link_size);
      FillNormal(random, &link.shared);
      chain.links.push_back(link);
    }
    for (int i = 0; i < shape.landmarks_per_keyframe; ++i) {
      chain.landmarks.push_back(RandomTrack(k, shape, random));
    }
  }
  if (shape.turned) TurnPoses(random, &chain);
  // In any order.
  std::shuffle(chain.landmarks.begin(), chain.landmarks.end(), *random);
  chain.kept_landmarks.assign(chain.landmarks.size(), -1);
  if (shape.kept == 0) return chain;
  for (int& kept : chain.kept_landmarks) {
    if (!std::bernoulli_distribution(shape.kept)(*random)) continue;
    kept = chain.kept;
    chain.kept += 3;
  }
  FillNormal(random, &chain.kept_state);
  chain.kept_state = chain.kept_state.cwiseAbs2();
  chain.kept_state_at = chain.kept;
  chain.kept += kChainStateSize;
  const auto rows = [&] {
    KeptBiasRows result;
    FillNormal(random, &result.by_bias);
    FillNormal(random, &result.by_kept);
    FillNormal(random, &result.residual);
    return result;
  };
  chain.kept_bias = {rows(), rows()};
  chain.kept += 6;
  return chain;
}

SharedInformation Eliminate(const Chain& chain,
                            ChainElimination* elimination,
                            ChainElimination::Record record) {
  std::vector<int> tracks = {0};
  std::vector<int> keyframes;
  for (const auto& track : chain.landmarks) {
    for (const ChainObservation& observation : track) {
      keyframes.push_back(observation.keyframe);
    }
    tracks.push_back(static_cast<int>(keyframes.size()));
  }
  elimination->Start({chain.keyframes(),
                      chain.link_size,
                      chain.cameras,
                      tracks,
                      keyframes,
                      chain.kept,
                      chain.kept_landmarks,
                      chain.state_size - kChainPoseSize},
                     record);
  for (int k = 0; k < chain.keyframes(); ++k) {
    for (int camera = 0; camera < static_cast<int>(chain.cameras.size());
         ++camera) {
      AddObservations(chain, k, camera, elimination);
    }
  }
  for (int m = 0; m < static_cast<int>(chain.landmarks.size()); ++m) {
    elimination->AddLandmarkPrior(
        m,
        chain.landmark_prior * Eigen::Matrix3d::Identity(),
        chain.landmark_prior_slope);
  }
  for (int k = 0; k < chain.keyframes(); ++k) {
    elimination->AddPrior(chain.priors[k]);
    if (chain.kept_bias && k == 0) {
      elimination->AddKeptBias(chain.kept - 6, chain.kept_bias->first);
    }
    if (chain.kept_bias && k + 1 == chain.keyframes()) {
      elimination->AddKeptBias(chain.kept - 6, chain.kept_bias->second);
    }
    if (chain.kept_bias && k == chain.keyframes() / 2) {
      elimination->AddKeptState(chain.kept_state_at, chain.kept_state);
    }
    if (k + 1 < chain.keyframes()) {
      elimination->Advance(Solve(chain, chain.links[k]).View());
    }
  }
  SharedInformation result;
  elimination->Finish(&result);
  return result;
}

DenseProblem MakeDense(const Chain& chain) {
  const int size = chain.state_size;
  const int landmarks = static_cast<int>(chain.landmarks.size());
  const int states = 3 * landmarks;
  const int shared = states + size * chain.keyframes();
  const int columns = shared + chain.shared_size();
  // Rows of zeros below, so that there are never fewer rows than columns.
  int rows = columns + 12 + kChainStateSize;
  for (const ChainRows& link : chain.links) {
    rows += static_cast<int>(link.residual.size());
  }
  for (const auto& track : chain.landmarks) {
    rows += 2 * static_cast<int>(track.size());
  }
  DenseProblem dense;
  dense.J = Eigen::MatrixXd::Zero(rows, columns);
  dense.r = Eigen::VectorXd::Zero(rows);
  const double root = std::sqrt(chain.landmark_prior);
  int row = 0;
  const int kept = columns - chain.kept;
  // First column of a landmark. A kept landmark leaves its own column empty
  // except for a unit row, so that its step there is zero.
  const auto column = [&](int m) {
    return chain.kept_landmarks[m] < 0 ? 3 * m : kept + chain.kept_landmarks[m];
  };
  for (int m = 0; m < landmarks; ++m) {
    for (int i = 0; i < 3; ++i, ++row) {
      dense.J(row, column(m) + i) = root;
      dense.r(row) = chain.landmark_prior_slope(i) / root;
    }
  }
  for (const ChainStateMatrix& prior : chain.priors) {
    dense.J.block(row, row, size, size) = prior.llt().matrixU();
    row += size;
  }
  std::vector<int> offsets = {shared + chain.link_size};
  for (const LandmarkRows& rows : chain.cameras) {
    offsets.push_back(offsets.back() + rows.shared);
  }
  for (int m = 0; m < landmarks; ++m) {
    for (const ChainObservation& a : chain.landmarks[m]) {
      dense.J.block<2, 3>(row, column(m)) = -a.position;
      dense.J.block<2, 6>(row, states + size * a.keyframe) = ByPose(a);
      const LandmarkRows& columns_of = chain.cameras[a.camera];
      dense.J.block(row, offsets[a.camera], 2, columns_of.shared) =
          ByCamera(columns_of, a);
      dense.r.segment<2>(row) = a.residual;
      row += 2;
    }
  }
  for (std::size_t k = 0; k < chain.links.size(); ++k) {
    const int at = states + size * static_cast<int>(k);
    const ChainRows& a = chain.links[k];
    const auto of_link = static_cast<int>(a.residual.size());
    dense.J.block(row, at, of_link, size) = a.x0;
    dense.J.block(row, at + size, of_link, size) = a.x1;
    dense.J.block(row, shared, of_link, chain.link_size) = a.shared;
    dense.r.segment(row, of_link) = a.residual;
    row += of_link;
  }
  if (chain.kept_bias) {
    const auto add = [&](int keyframe, const KeptBiasRows& rows) {
      const int at = states + size * keyframe + 9;
      dense.J.block<6, 6>(row, at) = rows.by_bias.asDiagonal();
      dense.J.block<6, 6>(row, columns - 6) = rows.by_kept.asDiagonal();
      dense.r.segment<6>(row) = rows.residual;
      row += 6;
    };
    add(0, chain.kept_bias->first);
    add(chain.keyframes() - 1, chain.kept_bias->second);
    const ChainStateVector root = chain.kept_state.cwiseSqrt();
    const int at = states + size * (chain.keyframes() / 2);
    dense.J.block<15, 15>(row, at) = root.asDiagonal();
    dense.J.block<15, 15>(row, kept + chain.kept_state_at) -=
        root.asDiagonal().toDenseMatrix();
    row += kChainStateSize;
  }
  // The unknowns that kept landmarks do not use.
  for (int m = 0; m < landmarks; ++m) {
    if (chain.kept_landmarks[m] < 0) continue;
    for (int i = 0; i < 3; ++i, ++row) dense.J(row, 3 * m + i) = 1;
  }
  return dense;
}

SharedInformation DenseReference(const Chain& chain) {
  const DenseProblem dense = MakeDense(chain);
  using Matrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
  const Eigen::HouseholderQR<Matrix> qr(dense.J.cast<long double>());
  const int columns = static_cast<int>(dense.J.cols());
  const int D = chain.shared_size();
  const Matrix R = qr.matrixQR()
                       .topRows(columns)
                       .bottomRightCorner(D, D)
                       .triangularView<Eigen::Upper>();
  const Matrix c = (qr.householderQ().transpose() * dense.r.cast<long double>())
                       .middleRows(columns - D, D);
  return {(R.transpose() * R).cast<double>(),
          (-R.transpose() * c).cast<double>()};
}

}  // namespace selfcal
