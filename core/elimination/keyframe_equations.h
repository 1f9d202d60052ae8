// The normal equations of the keyframes of a chain and of the camera
// parameters, apart from the parts with landmarks, summed over all
// observations. Internal to core/elimination.
#pragma once

#include <vector>

#include "core/elimination/chain_front.h"
#include "core/elimination/chain_layout.h"
#include "core/elimination/chain_unknowns.h"
#include "core/elimination/landmark_equations.h"

namespace selfcal {

// Products of all columns of rows of landmark_rows.h with each other, the lower
// triangle by columns.
struct RowProducts {
  double operator()(int i, int j) const {
    return i >= j ? data[j * stride + i] : data[i * stride + j];
  }

  const double* data;
  int stride;
};

class KeyframeEquations {
 public:
  // Begins a chain, with sums of zero.
  void Start(const ChainLayout& layout, int keyframes);
  // Exchanges memory with the sums of a chain that is finished.
  void TakeMemory(KeyframeEquations* finished) { sums_.swap(finished->sums_); }

  // Adds the products to those of the keyframe and the camera that they
  // represent. The matrix is B of the rows; null: [1; 0].
  void Add(int keyframe,
           const CameraColumns& camera,
           const RowProducts& products,
           const ChainPoseRotation* by_rotation);

  // Adds the sums of a keyframe to the front, where it has slot 0.
  void AddKeyframeTo(ChainFront* front, int keyframe) const;
  // Adds the sums among camera parameters and constant to the front: once,
  // after the last keyframe.
  void AddSharedTo(ChainFront* front) const;

 private:
  void AddShared(const CameraColumns& camera, const RowProducts& products);

  ChainLayout layout_;
  // For each keyframe 6 rows over its pose, camera parameters and constant.
  std::vector<double> sums_;
  int stride_ = 0;
  // Over camera parameters and constant, lower triangle by columns.
  std::vector<double> shared_sums_;
};

}  // namespace selfcal
