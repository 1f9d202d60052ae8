// The computations of InertialBatch for W links at once. Internal to
// core/factor.
//
// Defined in inertial_kernel.cc, which is compiled once for each W. The
// interface uses plain numbers only: an inline function of a library's
// container, compiled there for wider vectors, could become the copy that the
// whole program uses.
#pragma once

#include "core/factor/inertial_batch.h"
#include "core/model/imu_model.h"

namespace selfcal::inertial {

// Row of a reading: length of the step before it [s], gyro 3, accel 3. The
// length of the first is zero.
constexpr int kReadingSize = 7;
// Gyroscope, accelerometer.
constexpr int kDensities = 2;
// q_GI (x, y, z, w), p_GI, v_GI, b_a, b_g.
constexpr int kStateNumbers = 16;

// The numbers of the W links are interleaved.
template <int W>
struct KernelInput {
  int rows = 0;
  const double* readings = nullptr;  // rows x kReadingSize x W
  // Noise over the step before each reading, rows x kDensities x W. Only if
  // roots are computed from noise.
  const double* densities = nullptr;
  double x0[kStateNumbers][W];
  double x1[kStateNumbers][W];
  double dt_s[W];
  // Common to all links.
  ImuCorrection imu;
  bool coupled = false;
  TransitionColumns columns = TransitionColumns(0);
  double gravity_mps2 = 0;
};

// The place at which the transition of a link is stored; G has the columns of
// KernelInput::columns.
struct TransitionTarget {
  double* G;
  double* A;
  double* whitened;
};

// Fills out, and computes the roots from the noise.
template <int W>
void LineariseLinks(const KernelInput<W>& input,
                    const ImuNoise& noise,
                    InertialNoiseRoot* const* roots,
                    const TransitionTarget* out);

// Fills out with the given roots.
template <int W>
void LineariseLinksWithRoots(const KernelInput<W>& input,
                             const InertialNoiseRoot* const* roots,
                             const TransitionTarget* out);

// Computes 15 numbers for each link.
template <int W>
void WhitenedResiduals(const KernelInput<W>& input,
                       const InertialNoiseRoot* const* roots,
                       double* const* whitened);

}  // namespace selfcal::inertial
