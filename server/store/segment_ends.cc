#include "server/store/segment_ends.h"

#include <fmt/format.h>

#include <optional>
#include <utility>

#include "proto/convert.h"
#include "server/store/change_rows.h"
#include "server/store/checksum.h"
#include "server/store/fit_rows.h"
#include "server/store/record_parts.h"
#include "server/store/records.pb.h"
#include "server/store/rigs.h"
#include "server/store/runs.h"
#include "server/store/status_macros.h"
#include "server/store/store.h"

namespace selfcal::server {
namespace {

constexpr char kWhat[] = "what is remembered of a segment";

// Of a triangle with so many rows.
Eigen::Index Entries(Eigen::Index rows) { return rows * (rows + 1) / 2; }

bool GetTriangle(const google::protobuf::RepeatedField<double>& values,
                 Eigen::Index rows,
                 Eigen::MatrixXd* matrix) {
  if (values.size() != Entries(rows)) return false;
  matrix->resize(rows, rows);
  int k = 0;
  for (Eigen::Index i = 0; i < rows; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) {
      (*matrix)(i, j) = (*matrix)(j, i) = values[k++];
    }
  }
  return true;
}

}  // namespace

std::string SerializeEnds(const SegmentEnds& ends) {
  store::SegmentEndsRecord record;
  *record.mutable_theta0() = ToProto(ends.theta0);
  MotionSegment states;
  states.key = ends.key;
  states.keyframes = {ends.first, ends.last};
  states.imu = ends.tail;
  *record.mutable_states() = ToProto(states);
  for (Eigen::Index i = 0; i < ends.Lambda.rows(); ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) {
      record.add_lambda(ends.Lambda(i, j));
    }
  }
  PutVector(ends.eta, record.mutable_eta());
  return record.SerializeAsString();
}

absl::StatusOr<SegmentEnds> ParseEnds(std::string_view bytes) {
  store::SegmentEndsRecord record;
  SegmentEnds ends;
  MotionSegment states;
  if (!record.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())) ||
      !FromProto(record.theta0(), "", &ends.theta0).empty() ||
      !FromProto(record.states(), "", &states).empty() ||
      states.keyframes.size() != 2 ||
      record.eta_size() != TangentSize(ends.theta0) + kEndUnknowns ||
      !GetTriangle(record.lambda(), record.eta_size(), &ends.Lambda)) {
    return DamagedRecord(kWhat);
  }
  ends.key = states.key;
  ends.first = states.keyframes[0];
  ends.last = states.keyframes[1];
  ends.tail = std::move(states.imu);
  ends.eta = GetVector(record.eta());
  return ends;
}

absl::StatusOr<std::vector<RememberedSegment>> ListRememberedRows(
    Connection* db, const std::string& rig, std::int64_t run_number) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  SELFCAL_ASSIGN_OR_RETURN(const StoredRun run, ReadRun(db, rig, run_number));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t first_sequence,
                           FirstSequenceSince(db, rig, run.change));
  // Sessions in the order in which they began.
  Statement read(
      db,
      fmt::format("SELECT s.session, s.session_index, s.fit, "
                  "  s.receive_time_ns, e.ends, e.sha256, "
                  "  EXISTS (SELECT 1 FROM payloads p "
                  "    WHERE p.segment = s.segment) "
                  "FROM segment_ends e JOIN segments s USING (segment) "
                  "WHERE e.rig = ?1 AND s.state = 2 AND s.sequence >= ?2 "
                  "  AND {} "
                  "ORDER BY min(s.sequence) OVER (PARTITION BY s.session), "
                  "  s.session_index",
                  kFits),
      rig_id,
      first_sequence);
  std::vector<RememberedSegment> remembered;
  while (read.Next()) {
    RememberedSegment one;
    one.key = {read.Text(0), read.Int(1)};
    one.fit = read.Double(2);
    one.time_ns = read.Int(3);
    if (read.Int(6) == 0) {
      const std::string bytes = read.Text(4);
      if (!VerifySha256(bytes, read.Text(5), kWhat).ok()) continue;
      auto ends = ParseEnds(bytes);
      if (!ends.ok()) continue;
      one.ends = *std::move(ends);
    }
    remembered.push_back(std::move(one));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return remembered;
}

absl::Status WriteEnds(Connection* db,
                       std::int64_t rig,
                       std::int64_t segment,
                       const SegmentEnds& ends) {
  const std::string bytes = SerializeEnds(ends);
  const std::string sha256 = Sha256(bytes);
  SELFCAL_RETURN_IF_ERROR(
      Statement(db,
                "INSERT OR REPLACE INTO segment_ends (segment, rig, ends, "
                "  sha256) VALUES (?1, ?2, ?3, ?4)",
                segment,
                rig,
                BlobView{bytes},
                BlobView{sha256})
          .Run());
  return Statement(db,
                   "DELETE FROM segment_ends WHERE segment IN "
                   "  (SELECT e.segment FROM segment_ends e WHERE e.rig = ?1 "
                   "     AND NOT EXISTS (SELECT 1 FROM payloads p "
                   "       WHERE p.segment = e.segment) "
                   "   ORDER BY e.segment DESC LIMIT -1 OFFSET ?2)",
                   rig,
                   Store::kRemembered)
      .Run();
}

absl::Status ForgetSegment(Connection* db, std::int64_t segment) {
  return Statement(db, "DELETE FROM segment_ends WHERE segment = ?1", segment)
      .Run();
}

absl::Status ForgetBefore(Connection* db,
                          std::int64_t rig,
                          std::int64_t first_sequence) {
  return Statement(db,
                   "DELETE FROM segment_ends WHERE rig = ?1 AND segment IN "
                   "  (SELECT segment FROM segments "
                   "   WHERE rig = ?1 AND sequence < ?2)",
                   rig,
                   first_sequence)
      .Run();
}

}  // namespace selfcal::server
