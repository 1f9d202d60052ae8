// The products of the rows of one keyframe and camera: with the landmarks that
// it observes, and of all columns with each other. A workspace that keeps
// nothing but its memory. Internal to core/elimination.
#pragma once

#include <span>
#include <vector>

#include "core/elimination/chain_unknowns.h"
#include "core/elimination/dense_lanes.h"
#include "core/elimination/keyframe_equations.h"
#include "core/elimination/landmark_equations.h"
#include "core/simd/vector_width.h"

namespace selfcal {

class ObservationProducts {
 public:
  // Adds the products with landmarks to their sums, and returns the other
  // products, which are valid until the next call. The matrix is B of the rows;
  // null: [1; 0].
  RowProducts Add(VectorWidth width,
                  int camera,
                  const double* rows,
                  std::span<const int> observations,
                  const ChainPoseRotation* by_rotation,
                  LandmarkEquations* landmarks);

 private:
  void CollectPoses(int count);
  void SpreadPoses(int count, const ChainPoseRotation& by_rotation) const;

  struct PosePanel {
    double* data;
    int stride;
  };

  std::vector<double> gram_;
  std::vector<LandmarkTarget> targets_;
  std::vector<PosePanel> panels_of_poses_;
  std::vector<double> own_poses_;
};

}  // namespace selfcal
