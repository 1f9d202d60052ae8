// Determines how much of the information of a calibration stems from noise in
// its states.
//
// The information about theta depends on the motion, and the motion is
// estimated. If the true motion has no information about a direction, as a
// rotation about the IMU has none about the scale of the scene, the errors of
// the estimated states act as motion, and the information that they add is
// spurious. The cost does grow along such a direction, so that neither its
// curvature nor its growth reveals this. But noise accumulates: if noise of the
// same size is added to all measurements once more, and the states are
// estimated again, the spurious part doubles, while the information of the true
// motion stays the same (the idea of simulation extrapolation: Cook and
// Stefanski, "Simulation-extrapolation estimation in parametric measurement
// error models", 1994).
//
// Pure, callable from any thread; deterministic, the noise follows from a fixed
// seed.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "core/calibration/partition.h"
#include "core/calibration/screening.h"
#include "core/calibration/structured_solver.h"
#include "core/calibration/subspace.h"
#include "core/model/segment.h"

namespace selfcal {

// Returns the information about d (D x D, including the prior on theta) with
// noise added to every IMU reading and every pixel: the noise of the round's
// rig, that of pixels times pixel_factor. `round` and the rest are those of the
// calibration at its minimum, with a basis of no columns and a loss that suits
// residuals of this noise; `segments` and `partitioning` are those of its
// problem. Returns nullopt if the states reach no minimum.
std::optional<Eigen::MatrixXd> InformationUnderNoise(
    const SolverRound& round,
    const std::vector<const MotionSegment*>& segments,
    const Partitioning& partitioning,
    const CalibrationEstimate& estimate,
    const std::vector<ScreenedLandmark>& landmarks,
    double pixel_factor,
    std::uint64_t seed);

// If more than this fraction of its information stems from noise, the
// information is spurious, and its direction should be held constant. (True
// information has been seen to grow by up to 0.09 in one replica, spurious
// information by 0.28 to 0.95.)
inline constexpr double kSpurious = 0.3;

// Returns those of the estimated directions (D x n, orthonormal, in units of
// the prior) whose information, with all others unknown, is spurious. `Lambda`
// is that of the calibration, `under_noise` the results of
// InformationUnderNoise; the mean growth over these is compared with the limit.
Eigen::MatrixXd FindSpurious(const Rig& rig,
                             const ThetaSubspace& subspace,
                             const Eigen::MatrixXd& Lambda,
                             const std::vector<Eigen::MatrixXd>& under_noise,
                             double largest_growth);

// Result of InformationUnderNoise with the noise of a seed.
using NoiseReplica =
    std::function<std::optional<Eigen::MatrixXd>(std::uint64_t seed)>;

// Returns the spurious directions according to a few replicas, or to one if it
// shows none that might be; nullopt if the states reach no minimum in any.
std::optional<Eigen::MatrixXd> FindSpuriousByReplicas(
    const Rig& rig,
    const ThetaSubspace& subspace,
    const Eigen::MatrixXd& Lambda,
    const NoiseReplica& replica);

}  // namespace selfcal
