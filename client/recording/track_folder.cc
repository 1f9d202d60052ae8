#include "client/recording/track_folder.h"

#include <absl/status/status.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <map>
#include <system_error>
#include <utility>
#include <vector>

#include "client/recording/csv_list.h"

namespace selfcal::client {
namespace {

namespace fs = std::filesystem;

// The points of each image of one camera, by time.
using PointsByTime = std::map<std::int64_t, std::vector<RecordedPoint>>;

// Sorts points by landmark, keeps the first of each, and returns the number of
// the others.
std::size_t DropRepeated(std::vector<RecordedPoint>* points) {
  const std::size_t all = points->size();
  std::stable_sort(points->begin(),
                   points->end(),
                   [](const RecordedPoint& a, const RecordedPoint& b) {
                     return a.landmark < b.landmark;
                   });
  points->erase(std::unique(points->begin(),
                            points->end(),
                            [](const RecordedPoint& a, const RecordedPoint& b) {
                              return a.landmark == b.landmark;
                            }),
                points->end());
  return all - points->size();
}

class TrackRecording : public Recording {
 public:
  // `points` are those of the image times in `data`, by camera.
  TrackRecording(RecordedData data,
                 std::vector<std::vector<std::vector<RecordedPoint>>> points)
      : Recording(std::move(data)), points_(std::move(points)) {}

  absl::StatusOr<GreyPixels> ReadImage(int, int) override {
    return absl::FailedPreconditionError(
        "the recording has tracks and no images: state the calibration of its "
        "cameras with --from");
  }

  const std::vector<RecordedPoint>* Points(int camera,
                                           int image) const override {
    return &points_[static_cast<std::size_t>(camera)]
                   [static_cast<std::size_t>(image)];
  }

 private:
  const std::vector<std::vector<std::vector<RecordedPoint>>> points_;
};

}  // namespace

bool IsTrackFolder(const std::string& path) {
  std::error_code error;
  return fs::is_regular_file(fs::path(path) / "tracks.csv", error);
}

absl::StatusOr<std::unique_ptr<Recording>> OpenTrackFolder(
    const std::string& folder) {
  const fs::path list = fs::path(folder) / "tracks.csv";
  auto listed = ReadTrackCsv(list);
  if (!listed.ok()) return listed.status();
  std::vector<PointsByTime> by_camera;
  for (const ListedPoint& point : *listed) {
    const auto camera = static_cast<std::size_t>(point.camera);
    if (by_camera.size() <= camera) by_camera.resize(camera + 1);
    by_camera[camera][point.t_ns].push_back(point.point);
  }
  RecordedData data;
  std::vector<std::vector<std::vector<RecordedPoint>>> points;
  std::size_t repeated = 0;
  for (std::size_t j = 0; j < by_camera.size(); ++j) {
    if (by_camera[j].empty()) {
      return absl::NotFoundError(
          fmt::format("{}: camera {} has no points; number the cameras from 0",
                      list.string(),
                      j));
    }
    RecordedCamera& camera = data.cameras.emplace_back();
    camera.name = fmt::format("cam{}", j);
    points.emplace_back();
    for (auto& [t_ns, of_image] : by_camera[j]) {
      camera.image_times_ns.push_back(t_ns);
      repeated += DropRepeated(&of_image);
      points.back().push_back(std::move(of_image));
    }
  }
  if (repeated > 0) {
    data.problems.push_back(fmt::format(
        "{}: {} of {} points are listed again for the same image: left out",
        list.string(),
        repeated,
        listed->size()));
  }
  const absl::Status read = ReadImuLists(
      fs::path(folder) / "imu.csv", fs::path(folder) / "imu1.csv", &data);
  if (!read.ok()) return read;
  return std::make_unique<TrackRecording>(std::move(data), std::move(points));
}

}  // namespace selfcal::client
