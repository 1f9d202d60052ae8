// How much of what a calibration claims to know stems from noise in its states.
//
// The information about theta depends on the motion, and the motion is
// estimated: where it shows nothing of a direction, as a rotation about the
// IMU shows nothing of the scale of the scene, the errors of the estimated
// states stand in for motion, and the information that they bring is spurious.
// The cost does grow along such a direction, so that neither its curvature nor
// its growth tells. But noise adds up: once more noise of the same size is put
// on all measurements, and the states are solved for again, the spurious part
// is there twice, while what the motion shows stays as it is (the idea of
// simulation extrapolation: Cook and Stefanski, "Simulation-extrapolation
// estimation in parametric measurement error models", 1994).
//
// Pure, any thread; deterministic, the noise follows from a fixed seed.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/calibration/partition.h"
#include "core/calibration/screening.h"
#include "core/calibration/structured_solver.h"
#include "core/calibration/subspace.h"
#include "core/model/segment.h"

namespace selfcal {

// The information about d (D x D, the prior on theta included) with noise added
// to every reading of the IMU and every pixel, as the round's rig has it, that
// of pixels times pixel_factor. `round` and the rest are those of the
// calibration at its minimum, with a basis of no columns; `segments` and
// `partitioning` those that its problem was made of. Nothing where the states
// come to no minimum.
std::optional<Eigen::MatrixXd> InformationUnderNoise(
    const SolverRound& round,
    const std::vector<const MotionSegment*>& segments,
    const Partitioning& partitioning,
    const CalibrationEstimate& estimate,
    const std::vector<ScreenedLandmark>& landmarks,
    double pixel_factor,
    std::uint64_t seed);

// Information of which more than this part stems from noise is spurious: its
// direction is better held. (What is true alone has been seen to grow by up to
// 0.09 in one replica, what is not by 0.28 to 0.95.)
inline constexpr double kSpurious = 0.3;
// One replica that shows less than this shows that there is nothing.
inline constexpr double kMaybeSpurious = 0.15;

// Of the estimated directions (D x n, orthonormal, in units of the prior) those
// whose information, all others unknown, is spurious: `Lambda` is that of the
// calibration, `under_noise` what InformationUnderNoise made of it, and the
// mean of these shows by how large a part of it it grows.
Eigen::MatrixXd FindSpurious(const Rig& rig,
                             const ThetaSubspace& subspace,
                             const Eigen::MatrixXd& Lambda,
                             const std::vector<Eigen::MatrixXd>& under_noise,
                             double largest_growth);

}  // namespace selfcal
