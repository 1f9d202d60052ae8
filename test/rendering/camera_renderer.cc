#include "test/rendering/camera_renderer.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

namespace selfcal {
namespace {

// Places of the rays of a pixel: a turned square.
constexpr double kPlaces[4][2] = {
    {-0.125, -0.375}, {0.375, -0.125}, {-0.375, 0.125}, {0.125, 0.375}};
// The area that one of these rays stands for has this side [px].
constexpr double kRaySide_px = 0.5;
constexpr double kBlurDistance_m = 1;
constexpr float kTextureShift = 8192;  // [texels]; keeps coordinates positive
constexpr float kTiny = 1e-20F;

// log2 of a positive number within 0.09.
float RoughLog2(float x) {
  const auto bits = std::bit_cast<std::uint32_t>(x);
  return static_cast<float>(bits) * 0x1p-23F - 127;
}

}  // namespace

// A surface in the frame B of its box, into which rays in C are turned.
struct CameraRenderer::Solid {
  Eigen::Matrix3f R_BC;
  Eigen::Vector3f p_BC;
  Eigen::Vector3f half;
  Eigen::Vector3f centre_C;
  float radius = 0;
  float offset_u = 0;
  float offset_v = 0;

  // Whether a ray in the cone from the camera may meet the sphere about the
  // box: its centre is no further from the cone than its radius.
  bool MayMeet(const Eigen::Vector3f& axis, float cosine, float sine) const {
    const float along = axis.dot(centre_C);
    const float across =
        std::sqrt(std::max(0.0F, centre_C.squaredNorm() - along * along));
    return across * cosine - along * sine <= radius;
  }
};

namespace {

constexpr int kTile = 32;  // pixels of a row that are cast together

// The nearest surface along each ray of a tile.
struct Hits {
  float distance[kTile];
  int surface[kTile];
  int axis[kTile];
};

// Directions in B and where they leave or enter the box, by slabs.
template <bool kInside, typename Solid>
void Intersect(const Solid& solid,
               int surface,
               const float* __restrict x,
               const float* __restrict y,
               const float* __restrict z,
               Hits* __restrict hits) {
  const Eigen::Matrix3f& R = solid.R_BC;
  const Eigen::Vector3f& p = solid.p_BC;
  const Eigen::Vector3f& h = solid.half;
  const float r[9] = {R(0, 0),
                      R(0, 1),
                      R(0, 2),
                      R(1, 0),
                      R(1, 1),
                      R(1, 2),
                      R(2, 0),
                      R(2, 1),
                      R(2, 2)};
  const float px = p.x(), py = p.y(), pz = p.z();
  const float hx = h.x(), hy = h.y(), hz = h.z();
  for (int i = 0; i < kTile; ++i) {
    const float ix = 1 / (r[0] * x[i] + r[1] * y[i] + r[2] * z[i] + kTiny);
    const float iy = 1 / (r[3] * x[i] + r[4] * y[i] + r[5] * z[i] + kTiny);
    const float iz = 1 / (r[6] * x[i] + r[7] * y[i] + r[8] * z[i] + kTiny);
    // Middle of each slab along the ray, and half its length.
    const float mx = -px * ix, my = -py * iy, mz = -pz * iz;
    const float lx = hx * std::abs(ix);
    const float ly = hy * std::abs(iy);
    const float lz = hz * std::abs(iz);
    const float leaves = std::min(std::min(mx + lx, my + ly), mz + lz);
    if constexpr (kInside) {
      hits->distance[i] = leaves;
      hits->surface[i] = surface;
      hits->axis[i] = leaves == mx + lx ? 0 : leaves == my + ly ? 1 : 2;
    } else {
      const float enters = std::max(std::max(mx - lx, my - ly), mz - lz);
      const int axis = enters == mx - lx ? 0 : enters == my - ly ? 1 : 2;
      const bool nearer =
          (enters < leaves) & (enters > 0) & (enters < hits->distance[i]);
      hits->distance[i] = nearer ? enters : hits->distance[i];
      hits->surface[i] = nearer ? surface : hits->surface[i];
      hits->axis[i] = nearer ? axis : hits->axis[i];
    }
  }
}

}  // namespace

CameraRenderer::CameraRenderer(const CameraCalibration& camera)
    : q_CI_(camera.q_CI),
      p_CI_(camera.p_CI),
      width_px_(camera.width_px),
      height_px_(camera.height_px),
      tiles_((camera.width_px + kTile - 1) / kTile),
      line_delay_s_(camera.line_delay_s.value_or(0)),
      px_per_rad_(PixelsPerRadian(camera).maxCoeff()) {
  CacheRays(camera);
  CacheCones();
}

void CameraRenderer::CacheRays(const CameraCalibration& camera) {
  const int stride = tiles_ * kTile;
  const std::size_t size = static_cast<std::size_t>(stride) * height_px_;
  for (Rays& rays : rays_) {
    rays.x.assign(size, 0);
    rays.y.assign(size, 0);
    rays.z.assign(size, 1);
  }
  angle_.assign(size, 0);
  for (int v = 0; v < height_px_; ++v) {
    for (int u = 0; u < width_px_; ++u) {
      const std::size_t i = static_cast<std::size_t>(v) * stride + u;
      Eigen::Vector3d bearings[kPattern];
      bool all = true;
      for (int k = 0; k < kPattern; ++k) {
        const Eigen::Vector2d z_px(u + kPlaces[k][0], v + kPlaces[k][1]);
        all = all && Unproject(camera, z_px, &bearings[k]);
      }
      if (!all) continue;
      for (int k = 0; k < kPattern; ++k) {
        rays_[k].x[i] = static_cast<float>(bearings[k].x());
        rays_[k].y[i] = static_cast<float>(bearings[k].y());
        rays_[k].z[i] = static_cast<float>(bearings[k].z());
      }
      // Two places that are 0.79 px apart, along each diagonal.
      const double spread_px = std::hypot(0.75, 0.25);
      const double spread = std::max((bearings[3] - bearings[0]).norm(),
                                     (bearings[2] - bearings[1]).norm());
      angle_[i] = static_cast<float>(kRaySide_px * spread / spread_px);
    }
  }
}

void CameraRenderer::CacheCones() {
  cones_.resize(static_cast<std::size_t>(tiles_) * height_px_);
  for (std::size_t tile = 0; tile < cones_.size(); ++tile) {
    Cone& cone = cones_[tile];
    std::vector<Eigen::Vector3f> rays;
    for (std::size_t i = tile * kTile; i < (tile + 1) * kTile; ++i) {
      if (angle_[i] == 0) continue;
      for (const Rays& r : rays_) rays.emplace_back(r.x[i], r.y[i], r.z[i]);
    }
    if (rays.empty()) continue;
    cone.empty = false;
    for (const Eigen::Vector3f& ray : rays) cone.axis += ray;
    cone.axis.normalize();
    for (const Eigen::Vector3f& ray : rays) {
      cone.cosine = std::min(cone.cosine, cone.axis.dot(ray));
    }
    cone.sine = std::sqrt(std::max(0.0F, 1 - cone.cosine * cone.cosine));
  }
}

int CameraRenderer::RaysPerPixel(const Trajectory& trajectory,
                                 double t_s,
                                 double exposure_s) const {
  const BodyMotion motion = trajectory.At(t_s);
  const double radps = motion.w_I.norm() + motion.v_GI.norm() / kBlurDistance_m;
  const double blur_px = exposure_s * radps * px_per_rad_;
  return kPattern *
         std::max(1, static_cast<int>(std::ceil(blur_px / kPattern)));
}

void CameraRenderer::Render(const Scene& scene,
                            const Trajectory& trajectory,
                            double t_s,
                            double exposure_s,
                            std::vector<float>* radiance) const {
  const int rays = RaysPerPixel(trajectory, t_s, exposure_s);
  const int stride = tiles_ * kTile;
  std::vector<float> sums(static_cast<std::size_t>(stride) * height_px_, 0);
  std::vector<Solid> solids(scene.boxes.size() + 1);
  for (int k = 0; k < rays; ++k) {
    const double phase = (k + 0.5) / rays - 0.5;
    for (int v = 0; v < height_px_; ++v) {
      if (v == 0 || line_delay_s_ != 0) {
        const double row_s = t_s + v * line_delay_s_ + phase * exposure_s;
        Place(scene, trajectory.At(row_s), row_s, &solids);
      }
      // Rays take the levels above and below by turns, in an order that has
      // nothing to do with time: sharper rays early in the exposure would make
      // the image look as if it were exposed earlier.
      constexpr float kOrder[kPattern] = {2, 0, 3, 1};
      const float level_shift =
          (kOrder[k % kPattern] + (static_cast<float>(k / kPattern) + 0.5F) *
                                      kPattern / static_cast<float>(rays)) /
          kPattern;
      AddRow(scene.texture, solids, v, k % kPattern, level_shift, sums.data());
    }
  }
  radiance->resize(static_cast<std::size_t>(width_px_) * height_px_);
  const float scale = 1 / (255 * static_cast<float>(rays));
  for (int v = 0; v < height_px_; ++v) {
    const float* row = sums.data() + static_cast<std::size_t>(v) * stride;
    float* out = radiance->data() + static_cast<std::size_t>(v) * width_px_;
    for (int u = 0; u < width_px_; ++u) out[u] = scale * row[u];
  }
}

void CameraRenderer::Place(const Scene& scene,
                           const BodyMotion& motion,
                           double t_s,
                           std::vector<Solid>* solids) const {
  const Eigen::Quaterniond q_GC = motion.q_GI * q_CI_.conjugate();
  const Eigen::Matrix3d R_GC = q_GC.toRotationMatrix();
  const Eigen::Vector3d p_GC = motion.p_GI - q_GC * p_CI_;
  for (std::size_t i = 0; i < solids->size(); ++i) {
    const Box& box = scene.Surface(static_cast<int>(i));
    const Eigen::Matrix3d R_BG = box.Rotation().transpose();
    const Eigen::Vector3d centre_G = box.CentreAt(t_s);
    Solid& solid = (*solids)[i];
    solid.R_BC = (R_BG * R_GC).cast<float>();
    solid.p_BC = (R_BG * (p_GC - centre_G)).cast<float>();
    solid.half = box.half_m.cast<float>();
    solid.centre_C = (R_GC.transpose() * (centre_G - p_GC)).cast<float>();
    solid.radius = static_cast<float>(box.half_m.norm());
    solid.offset_u = static_cast<float>(scene.offsets[i].x()) + kTextureShift;
    solid.offset_v = static_cast<float>(scene.offsets[i].y()) + kTextureShift;
  }
}

void CameraRenderer::AddRow(const Texture& texture,
                            const std::vector<Solid>& solids,
                            int row,
                            int place,
                            float level_shift,
                            float* sums) const {
  const auto texels_per_m = static_cast<float>(1 / texture.texel_m());
  const int last_level = texture.levels() - 1;
  const Rays& rays = rays_[place];
  Hits hits;
  for (int tile = row * tiles_; tile < (row + 1) * tiles_; ++tile) {
    const Cone& cone = cones_[static_cast<std::size_t>(tile)];
    if (cone.empty) continue;
    const std::size_t first = static_cast<std::size_t>(tile) * kTile;
    const float* x = rays.x.data() + first;
    const float* y = rays.y.data() + first;
    const float* z = rays.z.data() + first;
    Intersect<true>(solids[0], 0, x, y, z, &hits);
    for (int s = 1; s < static_cast<int>(solids.size()); ++s) {
      const Solid& solid = solids[static_cast<std::size_t>(s)];
      if (!solid.MayMeet(cone.axis, cone.cosine, cone.sine)) continue;
      Intersect<false>(solid, s, x, y, z, &hits);
    }
    for (int i = 0; i < kTile; ++i) {
      const float angle = angle_[first + static_cast<std::size_t>(i)];
      if (angle == 0) continue;
      const Solid& solid = solids[static_cast<std::size_t>(hits.surface[i])];
      const int axis = hits.axis[i];
      const Eigen::Vector3f d_B =
          solid.R_BC * Eigen::Vector3f(x[i], y[i], z[i]);
      const Eigen::Vector3f p_B = solid.p_BC + hits.distance[i] * d_B;
      const float u = p_B[(axis + 1) % 3] * texels_per_m + solid.offset_u;
      const float v = p_B[(axis + 2) % 3] * texels_per_m + solid.offset_v;
      // Area of the footprint [texels], elongated where the face is seen at an
      // angle.
      const float side = hits.distance[i] * angle * texels_per_m;
      const float area = side * side / (std::abs(d_B[axis]) + kTiny);
      const float level = 0.5F * RoughLog2(area) + level_shift;
      const int whole = std::clamp(static_cast<int>(level), 0, last_level);
      sums[first + static_cast<std::size_t>(i)] +=
          kFaceBrightness[axis] * texture.At(u, v, whole);
    }
  }
}

}  // namespace selfcal
