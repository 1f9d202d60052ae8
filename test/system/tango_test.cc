// The estimator on a real recording: independent of its start, and the kept
// segments speak for all.
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>

#include "client/demo/device.h"
#include "core/calibration/calibrate.h"
#include "core/information/segment_information.h"
#include "core/model/so3.h"
#include "core/selection/baselines.h"
#include "test/recordings.h"

namespace selfcal::client {
namespace {

const CalibrateOptions kOptions{.threads = 2};

// What the tables of the rig hold after all segments.
std::vector<MotionSegment> Kept(const Device& device) {
  std::vector<SegmentInformation> information;
  for (const MotionSegment& segment : device.segments) {
    information.push_back(
        ScoreSegment(device.rig, device.rig.factory, segment));
  }
  std::vector<ScoredSegment> scored;
  for (std::size_t i = 0; i < information.size(); ++i) {
    scored.push_back({device.segments[i].key,
                      static_cast<std::int64_t>(i),
                      &information[i]});
  }
  std::vector<MotionSegment> kept;
  for (const TableEntry& entry :
       UnionOfTables(MostInformativeTables(device.rig, scored))) {
    kept.push_back(device.segments[entry.sequence]);
  }
  return kept;
}

void Print(const std::string& what, const CalibrationResult& result) {
  std::cout << what << ": status " << static_cast<int>(result.status) << " "
            << result.message << ", " << result.segments << " segments, "
            << result.iterations << " iterations, rank " << result.rank
            << ", cost " << result.initial_cost << " -> " << result.final_cost
            << ", rms " << result.reprojection_rms_before_px << " -> "
            << result.reprojection_rms_after_px << " px, median "
            << result.reprojection_median_before_px << " -> "
            << result.reprojection_median_after_px << " px\n";
}

double Degrees(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return a.angularDistance(b) * 180 / M_PI;
}

class TangoHandheld : public ::testing::Test {
 protected:
  // Null where the recording is not there.
  static const Device* Read() {
    static const std::string path = Recording("tango_handheld");
    if (path.empty()) return nullptr;
    static const Device device = [] {
      auto read = ReadDevice({path}, {40, 5e-5, 2e-3}).value();
      read.rig.pixel_sigma_px = 0.8;
      return read;
    }();
    return &device;
  }
  // The informative calibration from the stored one, made once.
  static const CalibrationResult& Informative(const Device& device) {
    static const CalibrationResult result =
        Calibrate(device.rig, device.rig.factory, Kept(device), kOptions);
    return result;
  }
};

// A start as wrong as a factory's: f 3 %, c 5 px, w 0.03, 1 deg, 2 cm; the IMU
// nominal.
Calibration WrongStart(const Calibration& stored) {
  Calibration start = stored;
  start.imu = ImuCalibration();
  for (CameraCalibration& camera : start.cameras) {
    camera.f *= 1.03;
    camera.c += Eigen::Vector2d(3, -4);
    camera.distortion[0] -= 0.03;
    camera.q_CI =
        camera.q_CI * Exp(Eigen::Vector3d(1, -1, 1).normalized() * M_PI / 180);
    camera.p_CI += 0.02 * Eigen::Vector3d(1, 1, -1).normalized();
  }
  return start;
}

TEST_F(TangoHandheld, AWrongStartLeadsToTheSameOptimum) {
  const Device* device = Read();
  if (!device) GTEST_SKIP() << "set SELFCAL_TEST_DATA to the recordings";
  const CalibrationResult& stored = Informative(*device);
  const CalibrationResult wrong = Calibrate(
      device->rig, WrongStart(device->rig.factory), Kept(*device), kOptions);
  Print("from the stored", stored);
  Print("from a wrong start", wrong);
  ASSERT_EQ(stored.status, CalibrateStatus::kConverged);
  ASSERT_EQ(wrong.status, CalibrateStatus::kConverged);
  const Eigen::VectorXd sigmas = stored.covariance.diagonal().cwiseSqrt();
  const Eigen::VectorXd difference = BoxMinus(wrong.theta, stored.theta);
  const auto components = TangentComponents(stored.theta);
  double largest = 0;
  for (const int i : FreeComponents(device->rig)) {
    const double error = std::abs(difference[i]) / sigmas[i];
    EXPECT_LE(error, 0.1) << components[i].name;
    largest = std::max(largest, error);
  }
  std::cout << "largest difference " << largest << " sigma\n";
}

TEST_F(TangoHandheld, TheKeptSegmentsAgreeWithTheBatch) {
  const Device* device = Read();
  if (!device) GTEST_SKIP() << "set SELFCAL_TEST_DATA to the recordings";
  const CalibrationResult& kept = Informative(*device);
  const CalibrationResult batch =
      Calibrate(device->rig, device->rig.factory, device->segments, kOptions);
  Print("kept", kept);
  Print("batch", batch);
  ASSERT_LT(kept.segments, batch.segments);
  ASSERT_EQ(kept.status, CalibrateStatus::kConverged);
  ASSERT_EQ(batch.status, CalibrateStatus::kConverged);
  const CameraCalibration& a = kept.theta.cameras[0];
  const CameraCalibration& b = batch.theta.cameras[0];
  const double f = 100 * (a.f - b.f).cwiseQuotient(b.f).cwiseAbs().maxCoeff();
  const double c = (a.c - b.c).cwiseAbs().maxCoeff();
  const double w = std::abs(a.distortion[0] - b.distortion[0]);
  const double q_CI = Degrees(a.q_CI, b.q_CI);
  const double p_CI = 100 * (a.p_CI - b.p_CI).norm();
  const double q_AI = Degrees(kept.theta.imu.q_AI, batch.theta.imu.q_AI);
  std::cout << "f " << f << " %, c " << c << " px, w " << w << ", q_CI " << q_CI
            << " deg, p_CI " << p_CI << " cm, q_AI " << q_AI << " deg\n";
  EXPECT_LE(f, 0.75);
  EXPECT_LE(c, 2);
  EXPECT_LE(w, 0.002);
  EXPECT_LE(q_CI, 0.4);
  EXPECT_LE(p_CI, 1.2);
  EXPECT_LE(q_AI, 0.5);
}

// Few and calm segments leave directions nearly unobserved, and landmarks that
// the cost would rather have in the centre of a camera.
TEST_F(TangoHandheld, AnyFewSegmentsConverge) {
  const Device* device = Read();
  if (!device) GTEST_SKIP() << "set SELFCAL_TEST_DATA to the recordings";
  const std::vector<int> choices[] = {{0, 3, 5, 7},
                                      {0, 7, 10, 12},
                                      {2, 3, 4, 6},
                                      {3, 5, 8, 11},
                                      {4, 5, 6, 10},
                                      {5, 6, 7, 13},
                                      {0, 3, 4, 5, 8},
                                      {4, 5, 6, 9, 11}};
  for (const std::vector<int>& choice : choices) {
    std::vector<MotionSegment> segments;
    for (const int i : choice) segments.push_back(device->segments[i]);
    const CalibrationResult result =
        Calibrate(device->rig, device->rig.factory, segments, kOptions);
    Print("few", result);
    EXPECT_EQ(result.status, CalibrateStatus::kConverged) << result.message;
  }
}

}  // namespace
}  // namespace selfcal::client
