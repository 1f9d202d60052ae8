// Mistakes about cameras and landmarks.
#include <algorithm>
#include <cmath>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "core/factor/keyframe_motion.h"
#include "core/factor/reprojection.h"
#include "core/model/so3.h"
#include "test/core/preflight/mistakes.h"

namespace selfcal {
namespace {

using Kind = FindingKind;

void InvertExtrinsics(FedData* data) {
  for (CameraCalibration& camera : data->rig.factory.cameras) {
    camera.q_CI = camera.q_CI.conjugate();
    camera.p_CI = -(camera.q_CI * camera.p_CI);
  }
}

// Sends the states of the camera as those of the body.
void SendCameraPoses(FedData* data) {
  const CameraCalibration& camera = data->rig.factory.cameras[0];
  const Eigen::Quaterniond q_IC = camera.q_CI.conjugate();
  for (MotionSegment& segment : data->segments) {
    for (KeyframeState& state : segment.keyframes) {
      state.p_GI -= state.q_GI * (q_IC * camera.p_CI);
      state.q_GI = state.q_GI * q_IC;
    }
  }
}

// The bridge has inverted extrinsics and computes the poses of the body from
// those of the camera with them: landmarks project correctly.
void MakePosesByInverse(FedData* data) {
  SendCameraPoses(data);
  InvertExtrinsics(data);
  const CameraCalibration& camera = data->rig.factory.cameras[0];
  for (MotionSegment& segment : data->segments) {
    for (KeyframeState& state : segment.keyframes) {
      state.p_GI += state.q_GI * camera.p_CI;
      state.q_GI = state.q_GI * camera.q_CI;
    }
  }
}

// A calibration made at another resolution of the images.
void ScaleCamera(FedData* data, double by) {
  for (CameraCalibration& camera : data->rig.factory.cameras) {
    camera.f *= by;
    camera.c *= by;
    camera.width_px = static_cast<int>(std::lround(by * camera.width_px));
    camera.height_px = static_cast<int>(std::lround(by * camera.height_px));
  }
}

// Landmarks as stored by the front end: in the camera that observed them first.
void AnchorLandmarks(FedData* data) {
  for (MotionSegment& segment : data->segments) {
    std::map<int, std::pair<int, int>> first;  // keyframe and camera
    for (const Observation& o : segment.observations) {
      const std::pair seen(o.keyframe, o.camera);
      const auto [at, added] = first.emplace(o.landmark, seen);
      if (!added) at->second = std::min<std::pair<int, int>>(at->second, seen);
    }
    for (const auto& [landmark, seen] : first) {
      const CameraCalibration& camera = data->rig.factory.cameras[seen.second];
      Eigen::Vector3d& p = segment.landmarks[landmark].p_G;
      const KeyframeState& state = segment.keyframes[seen.first];
      p = camera.q_CI * (state.q_GI.conjugate() * (p - state.p_GI)) +
          camera.p_CI;
    }
  }
}

constexpr double kReadout_s = 20e-3;

// Moves each pixel on its way in the image for as long as its row is exposed
// after the middle one, for which the states are.
void ExposeRowsOneAfterTheOther(FedData* data) {
  const Calibration& theta = data->rig.factory;
  for (MotionSegment& segment : data->segments) {
    KeyframeMotions motions;
    motions.Measure(data->rig,
                    theta,
                    std::vector<char>(theta.cameras.size(), 1),
                    segment.keyframes,
                    [&](std::size_t k) { return ContextOf(segment, k); });
    std::erase_if(segment.observations, [&](Observation& o) {
      const KeyframeState& x = segment.keyframes[o.keyframe];
      const CameraCalibration& camera = theta.cameras[o.camera];
      Eigen::Vector2d r_px;
      ReprojectionJacobians J;
      if (!Reproject(x.q_GI,
                     x.p_GI,
                     camera,
                     segment.landmarks[o.landmark].p_G.homogeneous(),
                     o.z_px,
                     &r_px,
                     &J,
                     motions.At(o.keyframe, o.camera))) {
        return true;
      }
      const double later_s = kReadout_s * (o.z_px.y() / camera.height_px - 0.5);
      o.z_px += later_s * J.camera.rightCols<1>();
      return o.z_px.x() < 0 || o.z_px.y() < 0 || o.z_px.x() > camera.width_px ||
             o.z_px.y() > camera.height_px;
    });
  }
}

// Landmarks in the frame of the session's first camera, as in ORB-SLAM's map,
// with poses in G.
void LandmarksOfFirstCamera(FedData* data) {
  const CameraCalibration& camera = data->rig.factory.cameras[0];
  const KeyframeState state = data->segments.front().keyframes.front();
  ForLandmarks(data, [&](Eigen::Vector3d* p) {
    *p = camera.q_CI * (state.q_GI.conjugate() * (*p - state.p_GI)) +
         camera.p_CI;
  });
}

}  // namespace

std::vector<Mistake> CameraMistakes() {
  return {
      {"extrinsics_inverted",
       {Kind::kExtrinsics},
       "are inverted",
       "invert",
       InvertExtrinsics},
      {"rotation_inverted",
       {Kind::kExtrinsics},
       "rotation",
       "conjugate",
       [](FedData* d) {
         for (auto& camera : d->rig.factory.cameras) {
           camera.q_CI = camera.q_CI.conjugate();
         }
       }},
      {"camera_poses",
       {Kind::kExtrinsics},
       "poses of the camera",
       "poses of the body",
       SendCameraPoses},
      {"poses_by_inverted_extrinsics",
       {Kind::kExtrinsics},
       "made with inverted",
       "invert",
       MakePosesByInverse},
      {"calibrated_at_double_size",
       {Kind::kFocalLength},
       "another resolution",
       "multiply",
       [](FedData* d) { ScaleCamera(d, 2); },
       0.5},
      {"calibrated_at_half_size",
       {Kind::kFocalLength},
       "another resolution",
       "multiply",
       [](FedData* d) { ScaleCamera(d, 0.5); },
       2},
      {"calibrated_at_two_thirds",
       {Kind::kFocalLength},
       "another resolution",
       "multiply",
       [](FedData* d) { ScaleCamera(d, 2. / 3); },
       1.5},
      {"focal_length_alone",
       {Kind::kFocalLength},
       "focal length is wrong",
       "multiply",
       [](FedData* d) {
         for (auto& camera : d->rig.factory.cameras) camera.f *= 1.25;
       },
       0.8},
      {"image_cropped",
       {Kind::kFocalLength},
       "principal point",
       "principal",
       [](FedData* d) {
         for (auto& camera : d->rig.factory.cameras) camera.c.x() += 80;
       },
       80},
      {"landmarks_in_camera",
       {Kind::kLandmarkFrame},
       "camera frame",
       "landmarks in G",
       AnchorLandmarks},
      {"landmarks_of_first_camera",
       {Kind::kLandmarkFrame},
       "another frame",
       "same frame G",
       LandmarksOfFirstCamera},
      {"rolling_shutter",
       {Kind::kRollingShutter},
       "one after the other",
       "line_delay_s",
       ExposeRowsOneAfterTheOther},
      {"landmarks_in_mm",
       {Kind::kLandmarkFrame},
       "when scaled by",
       "metres",
       [](FedData* d) {
         ForLandmarks(d, [](Eigen::Vector3d* p) { *p *= 1000; });
       },
       0.001},
  };
}

}  // namespace selfcal
