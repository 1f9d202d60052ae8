// Compares landmarks with the pixels that observed them, under hypotheses about
// wrong extrinsics, intrinsics and landmarks. If the data as sent predicts its
// pixels, no hypothesis is tested.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/preflight/checks.h"
#include "core/preflight/image_map.h"
#include "core/preflight/landmark_map.h"
#include "core/preflight/views.h"

namespace selfcal {
namespace {

constexpr std::size_t kMinViews = 50;
// A median error below this many pixel sigmas is not a finding.
constexpr double kFineSigmas = 2;
// Fractions of the pixels per radian: the error of an explanation is below
// kExplainedReprojection; one above kUnexplainedReprojection needs an
// explanation.
constexpr double kExplainedReprojection = 0.03;
constexpr double kUnexplainedReprojection = 0.1;
constexpr double kMinInFront = 0.7;
constexpr double kReprojectionGain = 3;
// Minimum difference of a scale from one, and of a shift from zero [of the
// width]; factory calibrations are more accurate.
constexpr double kMinScale = 0.1;
constexpr double kMinShift = 0.03;
// The same for another frame of landmarks: its scale, rotation and distance.
constexpr double kMinTurn_rad = 0.1;
constexpr double kMinDistance_m = 0.2;
// Explanations with few parameters are preferred to a free map of landmarks,
// unless the error of the map is below this fraction of theirs.
constexpr double kAsGood = 0.5;

struct Explanation {
  ReprojectionError error;
  Finding finding;  // its cause without the figures
};

Eigen::Vector3d AsReceived(const View& view) { return view.p; }

Explanation Extrinsics(const std::string& cause, const std::string& remedy) {
  return {{}, {FindingKind::kExtrinsics, cause, remedy, 0}};
}

// T_CI, which transforms a point from the body to the camera frame.
Eigen::Isometry3d FromBody(const CameraCalibration& camera) {
  return Eigen::Translation3d(camera.p_CI) * camera.q_CI;
}

bool IsFar(const LandmarkMap& map) {
  return std::abs(map.scale - 1) > kMinScale ||
         Eigen::AngleAxisd(map.R).angle() > kMinTurn_rad ||
         map.t.norm() > kMinDistance_m;
}

class ReprojectionCheck {
 public:
  // Checks camera j.
  ReprojectionCheck(const std::vector<CameraCalibration>& cameras,
                    std::size_t j,
                    const std::vector<View>& views,
                    double pixel_sigma_px)
      : cameras_(cameras),
        j_(j),
        camera_(cameras[j]),
        views_(views),
        f_px_(PixelsPerRadian(camera_).mean()),
        fine_px_(kFineSigmas * pixel_sigma_px),
        fed_(Measure(views, camera_, AsReceived)) {}

  const ReprojectionError& fed() const { return fed_; }

  std::optional<Finding> Run() const {
    if (fed_.median_px < fine_px_) return std::nullopt;
    std::optional<Explanation> best;
    for (const Explanation& one : Explanations()) {
      const bool better = !best || one.error.median_px < best->error.median_px;
      if (Explains(one.error) && better) best = one;
    }
    const bool gross = fed_.median_px > kUnexplainedReprojection * f_px_ ||
                       fed_.in_front < kMinInFront;
    if (gross) TryLandmarkMap(&best);
    if (best) return Complete(*best);
    if (!gross) return std::nullopt;
    return Mismatch();
  }

 private:
  bool Explains(const ReprojectionError& error) const {
    return error.median_px < kExplainedReprojection * f_px_ &&
           kReprojectionGain * error.median_px < fed_.median_px;
  }

  // A free map has so many parameters that without parallax it absorbs errors
  // of the calibration: it is tried for gross errors only.
  void TryLandmarkMap(std::optional<Explanation>* best) const {
    const auto map = FitLandmarkMap(views_, camera_);
    if (!map || !IsFar(*map)) return;
    const Explanation moved = MovedLandmarks(*map);
    const bool clearly =
        !*best || moved.error.median_px < kAsGood * (*best)->error.median_px;
    if (Explains(moved.error) && clearly) *best = moved;
  }

  std::vector<Explanation> Explanations() const {
    std::vector<Explanation> all;
    AddExtrinsics(&all);
    AddPoses(&all);
    AddAnchors(&all);
    const ImageMap map = FitImageMap(views_, camera_);
    if (std::abs(map.scale - 1) > kMinScale) {
      all.push_back(OtherScale(map));
    } else if (map.shift_px.norm() > kMinShift * camera_.width_px) {
      all.push_back(Cropped(map));
    }
    return all;
  }

  void AddWith(const Eigen::Quaterniond& q_CI,
               const Eigen::Vector3d& p_CI,
               Explanation explanation,
               std::vector<Explanation>* all) const {
    CameraCalibration other = camera_;
    other.q_CI = q_CI;
    other.p_CI = p_CI;
    explanation.error = Measure(views_, other, AsReceived);
    all->push_back(std::move(explanation));
  }

  void AddExtrinsics(std::vector<Explanation>* all) const {
    const Eigen::Quaterniond q = camera_.q_CI;
    const Eigen::Vector3d p = camera_.p_CI;
    const auto add = [&](const Eigen::Quaterniond& q_CI,
                         const Eigen::Vector3d& p_CI,
                         const Explanation& explanation) {
      AddWith(q_CI, p_CI, explanation, all);
    };
    add(q.conjugate(),
        -(q.conjugate() * p),
        Extrinsics("the extrinsics are inverted: landmarks project to where "
                   "they were seen with the inverse of T_CI",
                   "state q_ci and p_ci so that they take a point from the "
                   "body to the camera frame (p_C = R_CI p_I + p_CI); invert "
                   "what is stated now"));
    add(q.conjugate(),
        p,
        Extrinsics("the rotation of the extrinsics is inverted: landmarks "
                   "project to where they were seen with R_CI transposed",
                   "conjugate q_ci: it takes vectors from the body to the "
                   "camera frame"));
    add(q,
        -(q * p),
        Extrinsics("the position in the extrinsics is that of the camera in "
                   "the body frame: landmarks project to where they were seen "
                   "with p_CI = -R_CI p",
                   "state p_ci as the body's origin in the camera frame, "
                   "-R_CI p of the p that is stated now"));
  }

  // Tries keyframes that are poses of a camera, or were computed from these
  // with inverted extrinsics: they come from one of the cameras, and all
  // cameras observe the consequence.
  void AddPoses(std::vector<Explanation>* all) const {
    const Eigen::Isometry3d T_CI = FromBody(camera_);
    for (std::size_t k = 0; k < cameras_.size(); ++k) {
      const Eigen::Isometry3d T_KI = FromBody(cameras_[k]);
      const std::string which =
          cameras_.size() == 1 ? "the camera" : "cam" + std::to_string(k);
      const Eigen::Isometry3d of_camera = T_CI * T_KI.inverse();
      AddWith(Eigen::Quaterniond(of_camera.linear()),
              of_camera.translation(),
              Extrinsics("the keyframes are poses of " + which +
                             ": landmarks project to where they were seen "
                             "without the extrinsics",
                         "send the poses of the body: T_GI = T_GC T_CI"),
              all);
      // The camera that provided the poses has no error.
      if (k == j_) continue;
      const Eigen::Isometry3d by_inverse = T_CI.inverse() * T_KI * T_KI;
      AddWith(
          Eigen::Quaterniond(by_inverse.linear()),
          by_inverse.translation(),
          Extrinsics("the keyframes were made with inverted extrinsics of " +
                         which +
                         ": landmarks project to where they were seen "
                         "with these undone and the own inverted",
                     "invert q_ci and p_ci, which take a point from the "
                     "body to the camera frame, and make the poses with "
                     "them: T_GI = T_GC T_CI"),
          all);
    }
  }

  // Tries landmarks in the camera frame of the keyframe that observed them
  // first: `of` maps a view to the camera.
  template <typename Camera>
  Explanation AnchoredIn(const std::string& which, const Camera& of) const {
    return {Measure(views_,
                    camera_,
                    [&](const View& v) {
                      const CameraCalibration& c = cameras_[of(v)];
                      return v.first_exposure.ToG(c.q_CI.conjugate() *
                                                  (v.p - c.p_CI));
                    }),
            {FindingKind::kLandmarkFrame,
             "landmarks are in the camera frame" + which +
                 " of the keyframe that saw them first",
             "send landmarks in G: p_G = T_GI T_IC p_C",
             0}};
  }

  void AddAnchors(std::vector<Explanation>* all) const {
    Explanation body = {
        Measure(
            views_, camera_, [](const View& v) { return v.first.ToG(v.p); }),
        {FindingKind::kLandmarkFrame,
         "landmarks are in the body frame of the keyframe that saw them first",
         "send landmarks in G: p_G = T_GI p_I",
         0}};
    all->push_back(
        AnchoredIn("", [](const View& v) { return v.first_camera; }));
    if (cameras_.size() > 1) {
      all->push_back(AnchoredIn(" (of cam0)", [](const View&) { return 0; }));
    }
    all->push_back(body);
  }

  Explanation OtherScale(const ImageMap& map) const {
    const Eigen::Vector2d resized = map.shift_px;
    const Eigen::Vector2d focal_alone =
        map.shift_px - (1 - map.scale) * camera_.c;
    const std::string by = Figure(map.scale);
    Explanation e;
    e.error = map.error;
    e.finding.kind = FindingKind::kFocalLength;
    e.finding.value = map.scale;
    if (resized.norm() <= focal_alone.norm()) {
      e.finding.cause =
          "the intrinsics are of another resolution: the pixels "
          "are " +
          by + " times those that they predict";
      e.finding.remedy =
          "multiply focal length, principal point and image size of the "
          "calibration by " +
          by +
          ", or send pixels of the size of image "
          "that it was made for";
    } else {
      e.finding.cause =
          "the focal length is wrong: about the principal point "
          "the pixels are " +
          by + " times as far out as it predicts";
      e.finding.remedy = "multiply the focal length by " + by +
                         " (as a lens set to another zoom, or images cropped "
                         "about their middle and resized)";
    }
    return e;
  }

  Explanation Cropped(const ImageMap& map) const {
    const std::string by = "(" + Figure(map.shift_px.x()) + ", " +
                           Figure(map.shift_px.y()) + ") px";
    return {map.error,
            {FindingKind::kFocalLength,
             "the principal point is that of an image cut otherwise: the "
             "pixels lie " +
                 by + " from where they are predicted",
             "add " + by +
                 " to the principal point and state the size of the "
                 "image that pixels are sent of",
             map.shift_px.norm()}};
  }

  Explanation MovedLandmarks(const LandmarkMap& map) const {
    const double degrees =
        Eigen::AngleAxisd(map.R).angle() * 180 / std::numbers::pi;
    return {Measure(views_, camera_, [&](const View& v) { return map(v.p); }),
            {FindingKind::kLandmarkFrame,
             "landmarks are in another frame than the keyframes: they are "
             "seen where they were when scaled by " +
                 Figure(map.scale) + ", turned by " + Figure(degrees) +
                 " degrees and moved by (" + Figure(map.t.x()) + ", " +
                 Figure(map.t.y()) + ", " + Figure(map.t.z()) + ") m",
             "send landmarks and keyframes in the same frame G and in metres",
             std::abs(map.scale - 1) > kMinScale ? map.scale : 0}};
  }

  std::string Figures(const ReprojectionError& error) const {
    const std::string median = std::isfinite(error.median_px)
                                   ? Figure(error.median_px) + " px median"
                                   : "no median";
    return median + ", " + Figure(100 * error.in_front) + " % in front";
  }

  Finding Complete(const Explanation& best) const {
    Finding finding = best.finding;
    finding.cause +=
        " (" + Figures(best.error) + "; as sent " + Figures(fed_) + ")";
    if (finding.value == 0) {
      finding.value = fed_.median_px / std::max(best.error.median_px, 1e-3);
    }
    return finding;
  }

  Finding Mismatch() const {
    return {FindingKind::kReprojectionMismatch,
            "landmarks are not where they were seen, for no reason that is "
            "known (" +
                Figures(fed_) + ")",
            "check the camera's calibration and its index, that poses take "
            "the body frame to G (not the inverse), and that landmarks belong "
            "to the observations",
            fed_.median_px};
  }

  const std::vector<CameraCalibration>& cameras_;
  const std::size_t j_;
  const CameraCalibration& camera_;
  const std::vector<View>& views_;
  const double f_px_;
  const double fine_px_;
  const ReprojectionError fed_;
};

// Reports a finding once if several cameras have it.
class FindingsByCamera {
 public:
  void Add(const std::string& camera, Finding finding) {
    for (auto& [cameras, known] : findings_) {
      if (known.kind == finding.kind && known.remedy == finding.remedy) {
        cameras += ", " + camera;
        return;
      }
    }
    findings_.emplace_back(camera, std::move(finding));
  }

  void MoveTo(Diagnosis* diagnosis) {
    for (auto& [cameras, finding] : findings_) {
      finding.cause = cameras + ": " + finding.cause;
      diagnosis->findings.push_back(std::move(finding));
    }
  }

 private:
  std::vector<std::pair<std::string, Finding>> findings_;
};

}  // namespace

void CheckReprojection(const Rig& rig,
                       const Calibration& theta,
                       std::span<const MotionSegment> segments,
                       std::span<const double> late_s,
                       Diagnosis* diagnosis) {
  const auto cameras = static_cast<int>(theta.cameras.size());
  FindingsByCamera findings;
  for (int j = 0; j < cameras; ++j) {
    const std::string name = "cam" + std::to_string(j);
    const auto views = CollectViews(rig, theta, segments, late_s, j);
    if (views.size() < kMinViews) {
      diagnosis->not_checked.push_back(
          name + ": extrinsics, focal length and landmarks: only " +
          std::to_string(views.size()) + " observations");
      continue;
    }
    const ReprojectionCheck check(
        theta.cameras, static_cast<std::size_t>(j), views, rig.pixel_sigma_px);
    diagnosis->checked.push_back(
        name + ": extrinsics, focal length and landmarks: " +
        std::to_string(views.size()) + " observations, " +
        Figure(check.fed().median_px) + " px median");
    if (auto finding = check.Run()) findings.Add(name, *std::move(finding));
  }
  findings.MoveTo(diagnosis);
}

}  // namespace selfcal
