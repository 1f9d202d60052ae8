#include "client/tracking/corner_grid.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace selfcal::client {
namespace {

constexpr int kBlock_px = 5;
constexpr int kMargin_px = 4;  // of a cell, for gradients beyond its border

struct Corner {
  cv::Point2f point;
  float strength = 0;
};

bool IsApart(const cv::Point2f& point,
             const std::vector<cv::Point2f>& others,
             double distance_px) {
  return std::all_of(
      others.begin(), others.end(), [&](const cv::Point2f& other) {
        return cv::norm(point - other) >= distance_px;
      });
}

// The strongest corner of a cell that is apart from the points.
Corner BestOfCell(const cv::Mat& image,
                  const cv::Rect& cell,
                  const std::vector<cv::Point2f>& taken,
                  const CornerOptions& options) {
  const cv::Rect frame(0, 0, image.cols, image.rows);
  const cv::Rect wide = cv::Rect(cell.x - kMargin_px,
                                 cell.y - kMargin_px,
                                 cell.width + 2 * kMargin_px,
                                 cell.height + 2 * kMargin_px) &
                        frame;
  cv::Mat strengths;
  cv::cornerMinEigenVal(image(wide), strengths, kBlock_px);
  std::vector<cv::Point2f> near;
  for (const cv::Point2f& point : taken) {
    const auto reach = static_cast<float>(options.min_distance_px);
    if (point.x > cell.x - reach && point.y > cell.y - reach &&
        point.x < cell.x + cell.width + reach &&
        point.y < cell.y + cell.height + reach) {
      near.push_back(point);
    }
  }
  Corner best;
  for (int v = cell.y; v < cell.y + cell.height; ++v) {
    const float* row = strengths.ptr<float>(v - wide.y);
    for (int u = cell.x; u < cell.x + cell.width; ++u) {
      const float strength = row[u - wide.x];
      const cv::Point2f point(static_cast<float>(u), static_cast<float>(v));
      if (strength > best.strength &&
          IsApart(point, near, options.min_distance_px)) {
        best = {point, strength};
      }
    }
  }
  return best;
}

}  // namespace

std::vector<cv::Point2f> FindCorners(const cv::Mat& image,
                                     const std::vector<cv::Point2f>& taken,
                                     const CornerOptions& options) {
  const cv::Rect inner(options.border_px,
                       options.border_px,
                       image.cols - 2 * options.border_px,
                       image.rows - 2 * options.border_px);
  const int columns = (image.cols + options.cell_px - 1) / options.cell_px;
  const int rows = (image.rows + options.cell_px - 1) / options.cell_px;
  std::vector<char> occupied(static_cast<std::size_t>(columns) * rows, 0);
  const auto cell_of = [&](int column, int row) {
    return static_cast<std::size_t>(row) * columns + column;
  };
  for (const cv::Point2f& point : taken) {
    const int column = cvFloor(point.x) / options.cell_px;
    const int row = cvFloor(point.y) / options.cell_px;
    if (column >= 0 && row >= 0 && column < columns && row < rows) {
      occupied[cell_of(column, row)] = 1;
    }
  }
  std::vector<Corner> corners;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      if (occupied[cell_of(column, row)]) continue;
      const cv::Rect cell = cv::Rect(column * options.cell_px,
                                     row * options.cell_px,
                                     options.cell_px,
                                     options.cell_px) &
                            inner;
      if (cell.empty()) continue;
      const Corner best = BestOfCell(image, cell, taken, options);
      if (best.strength >= options.min_eigenvalue) corners.push_back(best);
    }
  }
  std::stable_sort(
      corners.begin(), corners.end(), [](const Corner& a, const Corner& b) {
        return a.strength > b.strength;
      });
  std::vector<cv::Point2f> chosen;
  for (const Corner& corner : corners) {
    if (IsApart(corner.point, chosen, options.min_distance_px)) {
      chosen.push_back(corner.point);
    }
  }
  return chosen;
}

}  // namespace selfcal::client
