// A room with boxes in it, some of them moving, all covered with one texture.
//
// Immutable: any thread may read it. The same seed and trajectory give the same
// bits.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/simulation/trajectory.h"
#include "test/rendering/texture.h"

namespace selfcal {

// A cuboid, turned about the vertical axis of G. Its centre is at
//   centre_G + sway_G sin(2 pi t / period + phase).
struct Box {
  Eigen::Vector3d centre_G = Eigen::Vector3d::Zero();  // [m]
  Eigen::Vector3d half_m = Eigen::Vector3d::Ones();    // half of each side
  double yaw_rad = 0;                                  // of the box in G
  Eigen::Vector3d sway_G = Eigen::Vector3d::Zero();    // [m]
  double period_s = 1;
  double phase_rad = 0;

  bool moves() const { return !sway_G.isZero(); }
  Eigen::Vector3d CentreAt(double t_s) const;
  // R_GB, from the frame of the box.
  Eigen::Matrix3d Rotation() const;
};

// The room is a box that is seen from the inside; surface 0 is the room,
// surface i the box i - 1.
struct Scene {
  Texture texture;
  Box room;
  std::vector<Box> boxes;
  // Offset of the texture on each surface [texels], so that no two look alike.
  std::vector<Eigen::Vector2d> offsets;

  const Box& Surface(int surface) const {
    return surface == 0 ? room : boxes[static_cast<std::size_t>(surface) - 1];
  }
};

// Brightness of a face, by the axis of its normal: as if lit from one side, so
// that the edges of boxes can be seen.
inline constexpr float kFaceBrightness[3] = {0.85F, 0.7F, 1.0F};

struct SceneOptions {
  int boxes = 14;
  int moving_boxes = 0;
  double moving_speed_mps = 0.5;  // the greatest of each moving box
  double wall_distance_m = 1.3;   // of walls, floor and ceiling from the path
  double clearance_m = 0.6;       // of boxes from the path
};

// A room around a trajectory, with boxes that never come near its path. A path
// that leaves no place for a box gets fewer of them.
Scene MakeRoom(const Trajectory& trajectory,
               const SceneOptions& options,
               std::uint64_t seed);

// The point at which a ray meets the scene.
struct Hit {
  int surface = 0;
  double distance_m = 0;
  // The point in the frame of its surface, in which it is at rest.
  Eigen::Vector3d p_B = Eigen::Vector3d::Zero();
};

// The first surface along a ray from p_G in the direction d_G, of unit length,
// at the time t_s. Nothing from outside the room.
std::optional<Hit> Cast(const Scene& scene,
                        const Eigen::Vector3d& p_G,
                        const Eigen::Vector3d& d_G,
                        double t_s);

// The point of a hit at another time.
Eigen::Vector3d PointAt(const Scene& scene, const Hit& hit, double t_s);

}  // namespace selfcal
