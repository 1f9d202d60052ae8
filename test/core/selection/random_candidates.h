// Candidates with random information, and with the landmarks that a test gives
// them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

#include "core/selection/candidate.h"

namespace selfcal {

inline Eigen::MatrixXd RandomInformation(int size,
                                         int rank,
                                         double scale,
                                         std::mt19937* random) {
  std::normal_distribution<double> normal;
  Eigen::MatrixXd root(rank, size);
  for (auto& x : root.reshaped()) x = scale * normal(*random);
  return root.transpose() * root;
}

// The sketch of a segment that sees these landmarks, each as often.
inline LandmarkSketch SketchOf(const std::vector<std::uint64_t>& ids,
                               int observations = 5) {
  MotionSegment segment;
  std::vector<int> used;
  for (std::size_t m = 0; m < ids.size(); ++m) {
    segment.landmarks.push_back({ids[m], Eigen::Vector3d::Zero()});
    for (int i = 0; i < observations; ++i) {
      used.push_back(static_cast<int>(segment.observations.size()));
      segment.observations.push_back(
          {0, 0, static_cast<std::int32_t>(m), Eigen::Vector2d::Zero()});
    }
  }
  LandmarkSketch sketch;
  SketchLandmarks(segment, used, &sketch);
  return sketch;
}

inline std::vector<std::uint64_t> Range(std::uint64_t begin,
                                        std::uint64_t end) {
  std::vector<std::uint64_t> ids;
  for (std::uint64_t id = begin; id < end; ++id) ids.push_back(id);
  return ids;
}

inline Candidate MakeTestCandidate(int index,
                                   Eigen::MatrixXd information,
                                   LandmarkSketch landmarks = {}) {
  return {
      {"session", index}, index, std::move(information), std::move(landmarks)};
}

}  // namespace selfcal
