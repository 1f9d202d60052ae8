#include "server/store/segment_path.h"

#include <algorithm>

#include "selfcal/store/records.pb.h"
#include "server/status/status_macros.h"
#include "server/store/checksum.h"
#include "server/store/driver/statement.h"
#include "server/store/record_parts.h"

namespace selfcal::server {

std::vector<PathPoint> PathOf(const MotionSegment& segment) {
  const auto keyframes = static_cast<int>(segment.keyframes.size());
  const int points = std::min(keyframes, kMaxPathPoints);
  std::vector<PathPoint> path;
  for (int k = 0; k < points; ++k) {
    const int i = points == 1 ? 0 : k * (keyframes - 1) / (points - 1);
    const KeyframeState& state = segment.keyframes[i];
    constexpr double kSecondsPerNs = 1e-9;
    const auto since =
        static_cast<double>(state.t_ns - segment.keyframes.front().t_ns);
    path.push_back(
        {static_cast<float>(since * kSecondsPerNs), state.p_GI.cast<float>()});
  }
  return path;
}

std::string SerializePath(const std::vector<PathPoint>& path) {
  store::SegmentPathRecord record;
  for (const PathPoint& point : path) {
    record.add_seconds(point.seconds);
    for (const float x : point.p_GI) record.add_positions_m(x);
  }
  return record.SerializeAsString();
}

absl::StatusOr<std::vector<PathPoint>> ParsePath(std::string_view bytes,
                                                 const std::string& what) {
  store::SegmentPathRecord record;
  if (!ParseStored(bytes, &record) ||
      record.positions_m_size() != 3 * record.seconds_size()) {
    return DamagedRecord(what);
  }
  std::vector<PathPoint> path;
  for (int k = 0; k < record.seconds_size(); ++k) {
    path.push_back({record.seconds(k),
                    Eigen::Vector3f::Map(record.positions_m().data() + 3 * k)});
  }
  return path;
}

absl::Status InsertPath(UnitOfWork* tx,
                        std::int64_t sequence,
                        const std::vector<PathPoint>& path) {
  const std::string bytes = SerializePath(path);
  const std::string sha256 = Sha256(bytes);
  return Statement(tx->db(),
                   "INSERT INTO segment_paths (rig, sequence, path, sha256) "
                   "VALUES (?1, ?2, ?3, ?4)",
                   tx->rig_row(),
                   sequence,
                   BlobView{bytes},
                   BlobView{sha256})
      .Run();
}

}  // namespace selfcal::server
