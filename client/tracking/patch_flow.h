// Finds the patches about points of one image in another: pyramidal
// Lucas-Kanade from a prediction, confirmed backwards.
//
// Functions without state, callable from any thread; OpenCV may use threads of
// its own (cv::setNumThreads).
#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace selfcal::client {

struct FlowOptions {
  int window_px = 21;  // side of a patch, at every level of the pyramid
  int levels = 3;      // above the image itself
  // A patch that is tracked there and back ends at most this far from where it
  // began.
  double max_return_px = 0.5;
};

// An image of 8 bits with its smaller copies and their gradients.
using Pyramid = std::vector<cv::Mat>;
Pyramid BuildPyramid(const cv::Mat& image, const FlowOptions& options);

// Finds the patches about `points` of `from` in `to`. (*found)[i] is the
// prediction for point i, and becomes its place; returns whether it was found.
std::vector<char> FollowPatches(const Pyramid& from,
                                const Pyramid& to,
                                const std::vector<cv::Point2f>& points,
                                const FlowOptions& options,
                                std::vector<cv::Point2f>* found);

// Factor from the grey of patches about `from_points` to that about
// `to_points`, the median over all; 1 without points.
double BrightnessRatio(const cv::Mat& from,
                       const cv::Mat& to,
                       const std::vector<cv::Point2f>& from_points,
                       const std::vector<cv::Point2f>& to_points,
                       int window_px);

}  // namespace selfcal::client
