// Tracks of corners through the images of the cameras of a rig, of any camera
// model.
//
// Corners begin one in each free cell of a grid. Each is followed from image to
// image by Lucas-Kanade, from where the gyroscope's rotation predicts it, and
// back, and then aligned to its first patch (patch_template.h); those that do
// not agree with one motion of the camera end (epipolar_check.h). A new corner
// of one camera is looked for in the others, and has one landmark if it is
// found; matches between cameras that do not agree with their extrinsics end.
// Extrinsics and intrinsics of the rig need not be exact: the checks fit small
// rotations, and their limits follow the residuals.
//
// A tracker belongs to one thread at a time. It does no I/O; the same images
// and readings give the same tracks on one machine.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "client/tracking/corner_grid.h"
#include "client/tracking/patch_flow.h"
#include "client/tracking/patch_template.h"
#include "core/initialisation/epipolar_check.h"
#include "core/initialisation/gyro_rotation.h"
#include "core/model/calibration.h"

namespace selfcal::client {

struct TrackerOptions {
  // Corners begin in a camera with fewer tracks; matches of other cameras come
  // on top, up to as many again.
  int max_tracks = 200;
  CornerOptions corners = {};
  FlowOptions flow = {};
  // The distance of matches from their epipolar plane, between the images of
  // one camera and between those of two.
  double max_epipolar_px = 1.0;
  double max_stereo_px = 1.5;
  bool check_epipolar = true;  // false: nothing is rejected by geometry
  // Distances at which a new corner is assumed to be when it is looked for in
  // another camera.
  std::vector<double> stereo_distances_m = {3, 1.2, 10};
  // Every point is aligned to the first patch of its track, which ends if it
  // no longer resembles that. False: from image to image only.
  bool align = true;
  double min_correlation = 0.8;  // of the greys of both patches
  Eigen::Vector3d b_g = Eigen::Vector3d::Zero();  // [rad/s]
  // The time from which on the clocks of cameras drift; by default that of the
  // first image.
  std::optional<std::int64_t> session_start_ns = std::nullopt;
};

// One point of a track.
struct TrackPoint {
  std::uint64_t landmark = 0;  // from 1, the same in all cameras
  int camera = 0;
  int image = 0;  // number of the call of Track, from 0
  Eigen::Vector2d z_px = Eigen::Vector2d::Zero();
};

// Numbers of points that the last images lost, for diagnosis.
struct TrackingCounts {
  int followed = 0;         // points that were to be followed
  int lost = 0;             // not found, or not the way back
  int changed = 0;          // do not resemble their first patch
  int rejected = 0;         // against the motion of the camera
  int begun = 0;            // new landmarks
  int stereo_found = 0;     // of these, in a second camera
  int stereo_rejected = 0;  // against the extrinsics
};

class FeatureTracker {
 public:
  FeatureTracker(const Calibration& theta, const TrackerOptions& options);

  // Readings up to the last exposure of an image precede it. Prediction and
  // checks are by the images alone without them.
  void AddImu(const ImuSample& sample) { gyro_.Add(sample); }

  // Follows all tracks into the next images, one of 8 bits for each camera,
  // exposed at t_ns on the camera's own clock. An empty image was dropped: its
  // camera continues with the next one. Images of another type or size than
  // that of their camera are treated as dropped. Returns the points in these
  // images, in the order of landmarks for each camera.
  std::vector<TrackPoint> Track(std::int64_t t_ns,
                                const std::vector<cv::Mat>& images);

  const TrackingCounts& counts() const { return counts_; }

 private:
  struct Point {
    std::uint64_t landmark;
    cv::Point2f z_px;
    std::shared_ptr<const PatchTemplate> patch;
    Eigen::Matrix2d A = Eigen::Matrix2d::Identity();  // of its warp
  };
  struct Camera {
    CameraCalibration theta;
    Eigen::Vector3d origin_I;  // of the camera
    double px_per_rad;
    double line_delay_s;
    double t_s = 0;  // of the last image, on the clock of the IMU
    cv::Mat image;   // the last one; empty before the first
    Pyramid pyramid;
    cv::Mat smooth;  // the last one for patches
    std::vector<Point> points;
  };

  // A pyramid on the canvas: only those of one size can be compared.
  Pyramid PyramidOf(const cv::Mat& image) const;

  // A pixel of the last image of a camera, seen by another one, or by itself at
  // another time; at infinity unless a distance is given.
  std::optional<Eigen::Vector2d> Transfer(
      const Camera& from,
      const Eigen::Vector2d& z_px,
      const Camera& to,
      double to_s,
      std::optional<double> distance_m) const;
  // The same for a point with the surroundings of its patch. False if it has no
  // image.
  bool TransferWarp(const Camera& from,
                    const Point& point,
                    const Camera& to,
                    double to_s,
                    std::optional<double> distance_m,
                    PatchWarp* warp) const;
  // Moves a point to where its patch is in an image exposed at t_s, from
  // warp.z_px. False if it is not there.
  bool Align(const cv::Mat& smooth,
             const Camera& camera,
             double t_s,
             PatchWarp warp,
             Point* point) const;
  // The plane of a pixel of an image that was exposed at t_s.
  PatchPlane PlaneOf(const Camera& camera,
                     const Eigen::Vector2d& z_px,
                     double t_s) const;

  void Follow(int camera, const cv::Mat& image, double t_s);
  // Ends the points of a camera that do not agree with one motion; `before` has
  // the place of each in the image before.
  void CheckMotion(Camera* camera,
                   const std::vector<cv::Point2f>& before,
                   double before_s);
  // Orientations are those of the gyroscope but for what the first camera
  // shows: neither a bias nor a wrong rotation between camera and IMU adds up
  // over a track. `q_now_before` is the rotation of the body since its last
  // image.
  void CorrectDrift(double before_s, const Eigen::Quaterniond& q_now_before);
  void Replenish(int camera, const std::vector<char>& present);
  // Points to look for in another camera: those from `first` on, which are new,
  // and some of the others.
  std::vector<Point> Unmatched(const Camera& from,
                               std::size_t first,
                               const Camera& to) const;
  void MatchNew(const Camera& from, std::size_t first, Camera* to);
  bool HasRoom(const Camera& camera, const cv::Point2f& z_px) const;
  void CheckStereo(Camera* a, Camera* b);

  // Ray of a pixel in I, turned to the body at the exposure of row 0.
  std::optional<Eigen::Vector3d> RayOf(const Camera& camera,
                                       const Eigen::Vector2d& z_px,
                                       double t_s) const;

  TrackerOptions options_;
  GyroRotation gyro_;
  // Takes orientations of the gyroscope to those that the first camera shows.
  Eigen::Quaterniond drift_ = Eigen::Quaterniond::Identity();
  std::vector<Camera> cameras_;
  cv::Size canvas_;  // that all images fit into
  int images_ = 0;
  std::uint64_t next_landmark_ = 1;
  TrackingCounts counts_;
};

}  // namespace selfcal::client
