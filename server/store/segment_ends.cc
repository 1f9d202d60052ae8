#include "server/store/segment_ends.h"

#include <fmt/format.h>

#include <optional>
#include <utility>

#include "core/model/temperature.h"
#include "proto/convert.h"
#include "selfcal/store/records.pb.h"
#include "server/convert/convert.h"
#include "server/status/status_macros.h"
#include "server/store/checksum.h"
#include "server/store/driver/statement.h"
#include "server/store/record_parts.h"
#include "server/store/store.h"

namespace selfcal::server {
namespace {

constexpr char kWhat[] = "what is remembered of a segment";

// Number of entries of a triangle with this many rows.
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

absl::StatusOr<std::vector<std::int64_t>> ReadInts(Statement* read) {
  std::vector<std::int64_t> values;
  while (read->Next()) values.push_back(read->Int(0));
  SELFCAL_RETURN_IF_ERROR(read->status());
  return values;
}

}  // namespace

std::string SerializeEnds(const SegmentEnds& ends) {
  store::SegmentEndsRecord record;
  *record.mutable_theta0() = ToProto(ends.theta0);
  MotionSegment states;
  states.key = ends.key;
  states.temperature_c = ends.temperature_c;
  states.keyframes = {ends.first, ends.last};
  states.imu = ends.tail;
  *record.mutable_states() = ToProto(states);
  for (Eigen::Index i = 0; i < ends.Lambda.rows(); ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) {
      record.add_lambda(ends.Lambda(i, j));
    }
  }
  ToProto(ends.eta, record.mutable_eta());
  PutComponents(
      ends.theta0, ends.eta.size() - kEndUnknowns, record.mutable_components());
  return record.SerializeAsString();
}

absl::StatusOr<SegmentEnds> ParseEnds(std::string_view bytes) {
  store::SegmentEndsRecord record;
  SegmentEnds ends;
  MotionSegment states;
  const ComponentNames& names = record.components();
  if (!ParseStored(bytes, &record) ||
      !FromProto(record.theta0(), "", &ends.theta0).empty() ||
      !FromProto(record.states(), "", &states).empty() ||
      states.keyframes.size() != 2 ||
      !GetTriangle(record.lambda(), record.eta_size(), &ends.Lambda)) {
    return DamagedRecord(kWhat);
  }
  ends.eta = FromProto(record.eta());
  if (!ToTangent(ends.theta0, names, &ends.Lambda, kEndUnknowns) ||
      !ToTangent(ends.theta0, names, &ends.eta, kEndUnknowns) ||
      ends.eta.size() != TangentSize(ends.theta0) + kEndUnknowns) {
    return DamagedRecord(kWhat);
  }
  ends.key = states.key;
  ends.temperature_c = TemperatureOf(ends.theta0, states);
  ends.first = states.keyframes[0];
  ends.last = states.keyframes[1];
  ends.tail = std::move(states.imu);
  return ends;
}

absl::StatusOr<std::vector<EndsRow>> ReadEnds(
    UnitOfWork* tx,
    std::int64_t first_sequence,
    ExclusionCauses not_excluded_for) {
  Statement read(
      tx->db(),
      fmt::format("SELECT s.session, s.session_index, s.sequence, "
                  "  s.steady_ns, s.fit, e.ends, e.sha256, "
                  "  EXISTS (SELECT 1 FROM payloads p "
                  "    WHERE p.rig = ?1 AND p.sequence = s.sequence) "
                  "FROM segment_ends e CROSS JOIN segments s "
                  "WHERE s.rig = e.rig AND s.sequence = e.sequence "
                  "  AND e.rig = ?1 AND e.sequence >= ?2 AND s.state = 2 "
                  "  AND NOT {} "
                  "ORDER BY min(s.sequence) OVER (PARTITION BY s.session), "
                  "  s.session_index",
                  ExcludedFor("?3")),
      tx->rig_row(),
      first_sequence,
      not_excluded_for.bits());
  std::vector<EndsRow> rows;
  while (read.Next()) {
    EndsRow row{.segment = {.key = {read.Text(0), read.Int(1)},
                            .sequence = read.Int(2),
                            .state = SegmentState::kScored,
                            .receive_steady_ns = read.Int(3),
                            .fit = read.Double(4)},
                .has_data = read.Int(7) != 0};
    const std::string bytes = row.has_data ? "" : read.Text(5);
    if (!row.has_data && VerifySha256(bytes, read.Text(6), kWhat).ok()) {
      auto ends = ParseEnds(bytes);
      if (ends.ok() && ends->key == row.segment.key) {
        row.ends = *std::move(ends);
      }
    }
    rows.push_back(std::move(row));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return rows;
}

absl::StatusOr<std::vector<std::int64_t>> ArrivalsOfEnds(UnitOfWork* tx) {
  Statement read(tx->db(),
                 "SELECT s.steady_ns FROM segment_ends e "
                 "CROSS JOIN segments s "
                 "WHERE s.rig = e.rig AND s.sequence = e.sequence "
                 "AND e.rig = ?1 AND s.state = 2",
                 tx->rig_row());
  return ReadInts(&read);
}

absl::StatusOr<std::vector<std::int64_t>> EndsWithoutData(UnitOfWork* tx) {
  Statement read(tx->db(),
                 "SELECT e.sequence FROM segment_ends e WHERE e.rig = ?1 "
                 "AND NOT EXISTS (SELECT 1 FROM payloads p "
                 "  WHERE p.rig = ?1 AND p.sequence = e.sequence) "
                 "ORDER BY e.sequence DESC",
                 tx->rig_row());
  return ReadInts(&read);
}

absl::Status WriteEnds(UnitOfWork* tx,
                       std::int64_t sequence,
                       const SegmentEnds& ends) {
  const std::string bytes = SerializeEnds(ends);
  const std::string sha256 = Sha256(bytes);
  return Statement(tx->db(),
                   "INSERT INTO segment_ends (rig, sequence, ends, sha256) "
                   "VALUES (?1, ?2, ?3, ?4) "
                   "ON CONFLICT (rig, sequence) DO UPDATE SET "
                   "  ends = excluded.ends, sha256 = excluded.sha256",
                   tx->rig_row(),
                   sequence,
                   BlobView{bytes},
                   BlobView{sha256})
      .Run();
}

absl::Status DeleteEnds(UnitOfWork* tx, std::int64_t sequence) {
  return Statement(tx->db(),
                   "DELETE FROM segment_ends WHERE rig = ?1 AND sequence = ?2",
                   tx->rig_row(),
                   sequence)
      .Run();
}

absl::Status DeleteEndsBefore(UnitOfWork* tx, std::int64_t first_sequence) {
  return Statement(tx->db(),
                   "DELETE FROM segment_ends WHERE rig = ?1 AND sequence < ?2",
                   tx->rig_row(),
                   first_sequence)
      .Run();
}

}  // namespace selfcal::server
