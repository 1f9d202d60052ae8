#include "client/odometry/odometry.h"

#include <gtest/gtest.h>

#include "client/recording/recording.h"
#include "core/calibration/calibrate.h"
#include "core/calibration/theta_prior.h"
#include "test/client/tracking/recording_kinds.h"
#include "test/core/simulation/rigs.h"

namespace selfcal::client {
namespace {
TEST(Scratch, Folder) {
  const std::string folder = getenv("REC");
  auto rec = OpenRecording(folder, {});
  ASSERT_TRUE(rec.ok()) << rec.status();
  Rig truth = folder.find("stereo") != std::string::npos ? StereoRig() : HandheldRig("handheld");
  Rig rig = truth;
  if (getenv("WRONG")) {
    rig.factory = WrongStart(truth.factory);
      rig.blocks = {{"*.time_offset", true}};
      rig.groups = DefaultGroups(rig.blocks, int(rig.factory.cameras.size()));
      rig.prior_sigmas = {{"*.focal.*", 20}, {"*.principal.*", 10},
        {"*.p_CI.*", 0.05},{"*.q_CI.*", 0.06},{"*.time_offset", 0.02}};
  }
  Odometry odometry(rec->get(), rig, rig.factory, {.session = "a"});
  std::vector<MotionSegment> segments;
  for (;;) {
    auto next = odometry.Next(rig.factory, 1);
    ASSERT_TRUE(next.ok()) << next.status();
    if (!*next) break;
    std::printf("%d: %s kf %zu lm %zu obs %zu rms %.2f bg %.4f\n", int((*next)->segment.key.index), (*next)->failure.c_str(),
       (*next)->segment.keyframes.size(), (*next)->segment.landmarks.size(), (*next)->segment.observations.size(), (*next)->reprojection_rms_px, (*next)->segment.keyframes[0].b_g.norm());
    for (auto& v : Validate((*next)->segment, rig.factory)) std::printf("  %s %s\n", v.field.c_str(), v.message.c_str());
    if ((*next)->failure.empty()) segments.push_back((*next)->segment);
  }
        CalibrateOptions o;
        o.prior = FactoryPrior(rig);
        const CalibrationResult r = Calibrate(rig, rig.factory, segments, o);
        const Eigen::VectorXd d = BoxMinus(r.theta, truth.factory);
        double nees = 0;
        if (r.covariance.size()) {
          const auto f = FreeComponents(rig);
          nees = d(f).dot(Eigen::MatrixXd(r.covariance(f, f)).ldlt().solve(Eigen::VectorXd(d(f))));
          auto comps = TangentComponents(rig.factory);
          for (int i : f) std::printf("   %s %.6g sigma %.6g (%.1f)\n", comps[i].name.c_str(), d(i), std::sqrt(r.covariance(i,i)), d(i)/std::sqrt(r.covariance(i,i)));
        }
        const auto& c = r.theta.cameras[0];
        const auto& tc = truth.factory.cameras[0];
        std::printf("status %d %s its %d seg %d rms %.2f NEES %.1f of %d df %.2f dc %.2f dq %.4f dp %.4f dt %.4f held %zu track noise %.2f\n",
          int(r.status), r.message.c_str(), r.iterations, r.segments, r.reprojection_rms_after_px, nees, int(FreeComponents(rig).size()),
          (c.f - tc.f).norm(), (c.c - tc.c).norm(), c.q_CI.angularDistance(tc.q_CI), (c.p_CI - tc.p_CI).norm(), c.time_offset_s - tc.time_offset_s, r.held_constant.size(), r.track_noise_factor);
  for (auto& n : r.noise_scales) std::printf("noise %d %.3f +- %.3f\n", int(n.kind), n.factor, n.log_sigma);
}
}
}
