#include "test/rendering/scene.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/simulation/random.h"

namespace selfcal {
namespace {

constexpr std::uint64_t kRoomStream = 202;
constexpr double kPathStep_s = 0.05;
constexpr int kPlacementAttempts = 2000;
constexpr double kTextureOffset = 4096;  // [texels]

std::vector<Eigen::Vector3d> PathOf(const Trajectory& trajectory) {
  std::vector<Eigen::Vector3d> path;
  for (double t_s = 0; t_s < trajectory.duration_s(); t_s += kPathStep_s) {
    path.push_back(trajectory.At(t_s).p_GI);
  }
  path.push_back(trajectory.At(trajectory.duration_s()).p_GI);
  return path;
}

Box RoomAround(const std::vector<Eigen::Vector3d>& path, double distance_m) {
  Eigen::Vector3d low = path.front();
  Eigen::Vector3d high = path.front();
  for (const Eigen::Vector3d& p : path) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  Box room;
  room.centre_G = (low + high) / 2;
  room.half_m = (high - low) / 2 + Eigen::Vector3d::Constant(distance_m);
  return room;
}

// Distance of a point from the space that a box ever occupies, at least.
double DistanceFrom(const Box& box, const Eigen::Vector3d& p_G) {
  const Eigen::Matrix3d R_BG = box.Rotation().transpose();
  const Eigen::Vector3d half = box.half_m + (R_BG * box.sway_G).cwiseAbs();
  const Eigen::Vector3d q = R_BG * (p_G - box.centre_G);
  return (q.cwiseAbs() - half).cwiseMax(0).norm();
}

Box DrawBox(const Box& room, bool moves, double speed_mps, Random* random) {
  Box box;
  for (int axis = 0; axis < 3; ++axis) {
    box.centre_G[axis] =
        room.centre_G[axis] + room.half_m[axis] * random->Uniform(-0.95, 0.95);
    box.half_m[axis] = random->Uniform(0.12, 0.5);
  }
  box.yaw_rad = random->Uniform(0, std::numbers::pi);
  if (!moves) return box;
  const double direction = random->Uniform(0, 2 * std::numbers::pi);
  const double reach_m = random->Uniform(0.2, 0.6);
  box.sway_G =
      reach_m * Eigen::Vector3d(std::cos(direction), std::sin(direction), 0.2);
  box.period_s = 2 * std::numbers::pi * box.sway_G.norm() / speed_mps;
  box.phase_rad = random->Uniform(0, 2 * std::numbers::pi);
  return box;
}

bool IsClear(const Box& box,
             const std::vector<Eigen::Vector3d>& path,
             double clearance_m) {
  return std::all_of(path.begin(), path.end(), [&](const Eigen::Vector3d& p) {
    return DistanceFrom(box, p) > clearance_m;
  });
}

// Interval of distances along a ray inside a box, in the frame of the box.
struct Passage {
  double enters = -std::numeric_limits<double>::infinity();
  double leaves = std::numeric_limits<double>::infinity();
};

Passage Through(const Box& box,
                const Eigen::Vector3d& p_B,
                const Eigen::Vector3d& d_B) {
  Passage passage;
  for (int axis = 0; axis < 3; ++axis) {
    const double a = (-box.half_m[axis] - p_B[axis]) / d_B[axis];
    const double b = (box.half_m[axis] - p_B[axis]) / d_B[axis];
    passage.enters = std::max(passage.enters, std::min(a, b));
    passage.leaves = std::min(passage.leaves, std::max(a, b));
  }
  return passage;
}

}  // namespace

Eigen::Vector3d Box::CentreAt(double t_s) const {
  const double angle = 2 * std::numbers::pi * t_s / period_s + phase_rad;
  return centre_G + sway_G * std::sin(angle);
}

Eigen::Matrix3d Box::Rotation() const {
  return Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ())
      .toRotationMatrix();
}

Scene MakeRoom(const Trajectory& trajectory,
               const SceneOptions& options,
               std::uint64_t seed) {
  Random random(seed, kRoomStream);
  const std::vector<Eigen::Vector3d> path = PathOf(trajectory);
  Scene scene{
      MakeLeafTexture(seed), RoomAround(path, options.wall_distance_m), {}, {}};
  const std::size_t wanted =
      static_cast<std::size_t>(options.boxes + options.moving_boxes);
  for (int i = 0; i < kPlacementAttempts && scene.boxes.size() < wanted; ++i) {
    const bool moves =
        scene.boxes.size() >= static_cast<std::size_t>(options.boxes);
    const Box box =
        DrawBox(scene.room, moves, options.moving_speed_mps, &random);
    if (IsClear(box, path, options.clearance_m)) scene.boxes.push_back(box);
  }
  for (std::size_t i = 0; i <= scene.boxes.size(); ++i) {
    const double u = random.Uniform(0, kTextureOffset);
    const double v = random.Uniform(0, kTextureOffset);
    scene.offsets.emplace_back(u, v);
  }
  return scene;
}

std::optional<Hit> Cast(const Scene& scene,
                        const Eigen::Vector3d& p_G,
                        const Eigen::Vector3d& d_G,
                        double t_s) {
  std::optional<Hit> nearest;
  for (int i = 0; i <= static_cast<int>(scene.boxes.size()); ++i) {
    const Box& box = scene.Surface(i);
    const Eigen::Matrix3d R_BG = box.Rotation().transpose();
    const Eigen::Vector3d p_B = R_BG * (p_G - box.CentreAt(t_s));
    const Eigen::Vector3d d_B = R_BG * d_G;
    const Passage passage = Through(box, p_B, d_B);
    if (passage.leaves < passage.enters) continue;
    const double distance_m = i == 0 ? passage.leaves : passage.enters;
    if (i == 0 && passage.enters > 0) return std::nullopt;
    if (distance_m <= 0) continue;
    if (!nearest || distance_m < nearest->distance_m) {
      nearest = Hit{i, distance_m, p_B + distance_m * d_B};
    }
  }
  return nearest;
}

Eigen::Vector3d PointAt(const Scene& scene, const Hit& hit, double t_s) {
  const Box& box = scene.Surface(hit.surface);
  return box.CentreAt(t_s) + box.Rotation() * hit.p_B;
}

}  // namespace selfcal
