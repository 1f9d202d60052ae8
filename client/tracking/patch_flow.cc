#include "client/tracking/patch_flow.h"

#include <algorithm>
#include <opencv2/video/tracking.hpp>

#include "core/model/median.h"

namespace selfcal::client {
namespace {

constexpr int kMaxFlowSteps = 30;
constexpr double kEpsilon_px = 0.005;
// Smallest eigenvalue of the gradients of a patch, for each of its pixels: less
// is noise.
constexpr double kMinEigenvalue = 1e-4;

void Flow(const Pyramid& from,
          const Pyramid& to,
          const std::vector<cv::Point2f>& points,
          const FlowOptions& options,
          std::vector<cv::Point2f>* found,
          std::vector<unsigned char>* status) {
  std::vector<float> error;
  const cv::TermCriteria criteria(
      cv::TermCriteria::COUNT + cv::TermCriteria::EPS,
      kMaxFlowSteps,
      kEpsilon_px);
  cv::calcOpticalFlowPyrLK(from,
                           to,
                           points,
                           *found,
                           *status,
                           error,
                           {options.window_px, options.window_px},
                           options.levels,
                           criteria,
                           cv::OPTFLOW_USE_INITIAL_FLOW,
                           kMinEigenvalue);
}

}  // namespace

Pyramid BuildPyramid(const cv::Mat& image, const FlowOptions& options) {
  Pyramid pyramid;
  cv::buildOpticalFlowPyramid(
      image, pyramid, {options.window_px, options.window_px}, options.levels);
  return pyramid;
}

std::vector<char> FollowPatches(const Pyramid& from,
                                const Pyramid& to,
                                const std::vector<cv::Point2f>& points,
                                const FlowOptions& options,
                                std::vector<cv::Point2f>* found) {
  if (points.empty()) return {};
  std::vector<unsigned char> forward;
  std::vector<unsigned char> backward;
  Flow(from, to, points, options, found, &forward);
  std::vector<cv::Point2f> returned = points;
  Flow(to, from, *found, options, &returned, &backward);
  std::vector<char> ok(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const cv::Point2f difference = returned[i] - points[i];
    ok[i] = forward[i] && backward[i] &&
            cv::norm(difference) <= options.max_return_px;
  }
  return ok;
}

double BrightnessRatio(const cv::Mat& from,
                       const cv::Mat& to,
                       const std::vector<cv::Point2f>& from_points,
                       const std::vector<cv::Point2f>& to_points,
                       int window_px) {
  const cv::Rect from_frame(0, 0, from.cols, from.rows);
  const cv::Rect to_frame(0, 0, to.cols, to.rows);
  const auto patch = [&](const cv::Point2f& p) {
    return cv::Rect(cvRound(p.x) - window_px / 2,
                    cvRound(p.y) - window_px / 2,
                    window_px,
                    window_px);
  };
  std::vector<double> ratios;
  for (std::size_t i = 0; i < from_points.size(); ++i) {
    const cv::Rect a = patch(from_points[i]);
    const cv::Rect b = patch(to_points[i]);
    if ((a & from_frame) != a || (b & to_frame) != b) continue;
    const double before = cv::sum(from(a))[0];
    if (before > 0) ratios.push_back(cv::sum(to(b))[0] / before);
  }
  return ratios.empty() ? 1 : UpperMedian(std::move(ratios));
}

}  // namespace selfcal::client
