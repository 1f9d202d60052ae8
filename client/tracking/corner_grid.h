// New corners where an image has no tracks: the best one of each free cell of a
// grid.
//
// A function without state, callable from any thread.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace selfcal::client {

struct CornerOptions {
  int cell_px = 40;    // side of a cell of the grid
  int border_px = 12;  // no corners nearer to the border of the image
  // Smallest eigenvalue of the gradients about a corner, as
  // cv::cornerMinEigenVal scales it. 3e-4 is a corner of a few greys.
  double min_eigenvalue = 3e-4;
  double min_distance_px = 12;  // from tracks and from each other
};

// Corners in cells without any of the points `taken`, the strongest first.
std::vector<cv::Point2f> FindCorners(const cv::Mat& image,
                                     const std::vector<cv::Point2f>& taken,
                                     const CornerOptions& options);

}  // namespace selfcal::client
