// Elimination of the landmarks of a chain, all that are first observed from one
// keyframe at a time, and their back-substitution. Internal to
// core/elimination.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/elimination/chain_front.h"
#include "core/elimination/chain_layout.h"
#include "core/elimination/chain_shape.h"
#include "core/elimination/chain_structure.h"
#include "core/elimination/chain_unknowns.h"
#include "core/elimination/landmark_equations.h"
#include "core/simd/vector_width.h"

namespace selfcal {

class LandmarkElimination {
 public:
  explicit LandmarkElimination(VectorWidth width) : width_(width) {}

  void Start(const ChainShape& shape, const ChainLayout& layout);
  // Exchanges memory with that of a chain that is finished.
  void TakeMemory(LandmarkElimination* finished) {
    panels_.swap(finished->panels_);
  }

  // Moves the information of the landmarks of keyframe k, which has slot 0,
  // from their sums to the front. If `record`, the sums become their panels.
  void Eliminate(const ChainStructure& structure,
                 int k,
                 bool record,
                 LandmarkEquations* sums,
                 ChainFront* front);

  // The minimising step of each landmark (p_G [m]), for a step: z of the fixed
  // part of the front, which contains the steps of kept landmarks, and the
  // states of all keyframes. The panels must be recorded.
  void FindSteps(const LandmarkEquations& sums,
                 const Eigen::VectorXd& z,
                 const std::vector<ChainStateVector>& states,
                 std::vector<Eigen::Vector3d>* landmarks) const;

 private:
  void SetDepths(const ChainStructure& structure, std::span<const int> group);
  void SetRoot(int landmark, Eigen::Matrix3d information);
  void KeepLandmark(int landmark,
                    int slots,
                    const Eigen::Matrix3d& information,
                    double* panel,
                    int stride,
                    ChainFront* front);

  VectorWidth width_;
  ChainLayout layout_;
  std::vector<int> kept_;  // first kept unknown of each; -1: eliminated
  // The Cholesky factor of the information of each, with inverse diagonal.
  std::vector<double> roots_;
  // Panels of the landmarks that are eliminated together, 3 rows each over the
  // front from the camera parameters on.
  std::vector<double> panels_;
  std::vector<int> depths_;  // rows of the panels in each slot
};

}  // namespace selfcal
