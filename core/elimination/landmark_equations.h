// The normal equations of each landmark of a chain, summed over its factors;
// after its elimination its panel, for the back-substitution. Internal to
// core/elimination.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "core/elimination/chain_layout.h"
#include "core/elimination/chain_shape.h"
#include "core/elimination/chain_structure.h"
#include "core/elimination/chain_unknowns.h"
#include "core/elimination/dense_lanes.h"
#include "core/elimination/landmark_rows.h"
#include "core/elimination/landmark_views.h"

namespace selfcal {

// The parameters of a camera.
struct CameraColumns {
  LandmarkRows rows;
  int offset = 0;  // of the first among those of all cameras
};

class LandmarkEquations {
 public:
  // Begins a chain, with sums of zero.
  void Start(const ChainShape& shape,
             const ChainStructure& structure,
             const ChainLayout& layout);

  const CameraColumns& camera(int camera) const { return cameras_[camera]; }
  int landmarks() const { return views_.landmarks(); }

  // Where the products of an observation by a camera are added.
  LandmarkTarget TargetOf(int observation, int camera);
  // Adds x^T H x + 2 g^T x.
  void AddPrior(int landmark,
                const Eigen::Matrix3d& H,
                const Eigen::Vector3d& g);

  // Fills the panel of a landmark, 3 rows `stride` apart over the front from
  // the camera parameters on, from its sums. Returns its information.
  Eigen::Matrix3d PreparePanel(int landmark, double* panel, int stride) const;
  // Keeps the panel after the elimination, in place of the sums, for
  // ByRecordedPanel.
  void RecordPanel(int landmark, const double* panel, int stride);
  // The product of a recorded panel with a step: z of the fixed part of the
  // front, and the states of all keyframes.
  Eigen::Vector3d ByRecordedPanel(
      int landmark,
      const Eigen::VectorXd& z,
      const std::vector<ChainStateVector>& states) const;

 private:
  int PosesOf(int landmark) const;
  std::size_t PoseRow(int landmark, int row) const;

  ChainLayout layout_;
  std::vector<CameraColumns> cameras_;
  LandmarkViews views_;
  // For each landmark: for each camera 3 rows of sums, and 3 rows over the
  // poses that observe it. After RecordPanel, the rows over poses are those of
  // its panel, and the first 3 rows of the sums those over camera parameters
  // and constant.
  std::vector<double> sums_, pose_rows_, priors_;
  std::vector<int> sums_offsets_;  // of each camera
  int sums_size_ = 0;
};

}  // namespace selfcal
