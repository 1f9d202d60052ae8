#include "test/core/elimination/random_chain.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>

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
ChainStateMatrix NearRotation(std::mt19937* random) {
  ChainStateMatrix A;
  FillNormal(random, &A);
  const ChainStateMatrix Q = A.householderQr().householderQ();
  FillNormal(random, &A);
  return 4 * Q + 0.2 * A;
}

LandmarkRows RandomRows(int keyframe,
                        int camera,
                        const ChainShape& shape,
                        std::mt19937* random) {
  LandmarkRows rows;
  rows.keyframe = keyframe;
  rows.shared_offset = kLinkShared + camera * shape.camera_size;
  rows.shared.resize(2, shape.camera_size);
  FillNormal(random, &rows.residual);
  FillNormal(random, &rows.pose);
  FillNormal(random, &rows.shared);
  FillNormal(random, &rows.landmark);
  return rows;
}

std::vector<LandmarkRows> RandomTrack(int first,
                                      const ChainShape& shape,
                                      std::mt19937* random) {
  std::uniform_int_distribution<int> length(1, shape.max_track);
  std::bernoulli_distribution seen(shape.seen);
  const int end = std::min(shape.keyframes, first + length(*random));
  std::vector<LandmarkRows> rows;
  for (int k = first; k < end; ++k) {
    for (int camera = 0; camera < shape.cameras; ++camera) {
      if ((k == first && camera == 0) || seen(*random)) {
        rows.push_back(RandomRows(k, camera, shape, random));
      }
    }
  }
  return rows;
}

}  // namespace

Chain RandomChain(const ChainShape& shape, std::mt19937* random) {
  Chain chain;
  chain.shared_size = kLinkShared + shape.cameras * shape.camera_size;
  chain.landmark_prior = 1e-2;
  for (int k = 0; k < shape.keyframes; ++k) {
    chain.priors.push_back(1e-2 * ChainStateMatrix::Identity());
    if (k + 1 < shape.keyframes) {
      LinkRows link;
      link.shared.resize(kChainStateSize, kLinkShared);
      FillNormal(random, &link.residual);
      link.x0 = NearRotation(random);
      link.x1 = NearRotation(random);
      FillNormal(random, &link.shared);
      chain.links.push_back(link);
    }
    for (int i = 0; i < shape.landmarks_per_keyframe; ++i) {
      chain.landmarks.push_back(RandomTrack(k, shape, random));
    }
  }
  return chain;
}

SharedInformation Eliminate(const Chain& chain, ChainElimination* elimination) {
  elimination->Start(chain.shared_size);
  auto landmark = chain.landmarks.begin();
  for (int k = 0; k < chain.keyframes(); ++k) {
    elimination->AddPrior(chain.priors[k]);
    for (; landmark != chain.landmarks.end() && landmark->front().keyframe == k;
         ++landmark) {
      elimination->AddLandmark(*landmark, chain.landmark_prior);
    }
    if (k + 1 < chain.keyframes()) elimination->Advance(chain.links[k]);
  }
  return elimination->Finish();
}

DenseProblem MakeDense(const Chain& chain) {
  const int landmarks = static_cast<int>(chain.landmarks.size());
  const int states = 3 * landmarks;
  const int shared = states + kChainStateSize * chain.keyframes();
  const int columns = shared + chain.shared_size;
  // Rows of zeros below, so that there are never fewer rows than columns.
  int rows = columns + kChainStateSize * static_cast<int>(chain.links.size());
  for (const auto& track : chain.landmarks) {
    rows += 2 * static_cast<int>(track.size());
  }
  DenseProblem dense;
  dense.J = Eigen::MatrixXd::Zero(rows, columns);
  dense.r = Eigen::VectorXd::Zero(rows);
  int row = 0;
  for (; row < states; ++row) {
    dense.J(row, row) = std::sqrt(chain.landmark_prior);
  }
  for (const ChainStateMatrix& prior : chain.priors) {
    dense.J.block<kChainStateSize, kChainStateSize>(row, row) =
        prior.llt().matrixU();
    row += kChainStateSize;
  }
  for (int m = 0; m < landmarks; ++m) {
    for (const LandmarkRows& a : chain.landmarks[m]) {
      dense.J.block<2, 3>(row, 3 * m) = a.landmark;
      dense.J.block<2, 6>(row, states + kChainStateSize * a.keyframe) = a.pose;
      dense.J.block(row, shared + a.shared_offset, 2, a.shared.cols()) =
          a.shared;
      dense.r.segment<2>(row) = a.residual;
      row += 2;
    }
  }
  for (std::size_t k = 0; k < chain.links.size(); ++k, row += kChainStateSize) {
    const LinkRows& a = chain.links[k];
    const int at = states + kChainStateSize * static_cast<int>(k);
    dense.J.block<15, 15>(row, at) = a.x0;
    dense.J.block<15, 15>(row, at + kChainStateSize) = a.x1;
    dense.J.block(row, shared + a.shared_offset, 15, a.shared.cols()) =
        a.shared;
    dense.r.segment<15>(row) = a.residual;
  }
  return dense;
}

SharedInformation DenseReference(const Chain& chain) {
  const DenseProblem dense = MakeDense(chain);
  using Matrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
  const Eigen::HouseholderQR<Matrix> qr(dense.J.cast<long double>());
  const int columns = static_cast<int>(dense.J.cols());
  const int D = chain.shared_size;
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
