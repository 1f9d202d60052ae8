#include "server/store/session_rows.h"

#include <fmt/format.h>

#include <limits>
#include <optional>

#include "server/status/status_macros.h"
#include "server/store/checksum.h"
#include "server/store/paging.h"
#include "server/store/rigs.h"
#include "server/store/segment_path.h"
#include "server/store/segment_rows.h"
#include "server/store/table_rows.h"

namespace selfcal::server {
namespace {

absl::StatusOr<std::optional<std::string>> NextSession(
    Connection* db, std::int64_t rig, const std::string& after) {
  Statement read(db,
                 "SELECT session FROM segments WHERE rig = ?1 AND session > ?2 "
                 "ORDER BY session LIMIT 1",
                 rig,
                 after);
  std::optional<std::string> next;
  if (read.Next()) next = read.Text(0);
  SELFCAL_RETURN_IF_ERROR(read.status());
  return next;
}

absl::StatusOr<SessionSummary> Summarise(Connection* db,
                                         std::int64_t rig,
                                         const std::string& session) {
  SessionSummary summary;
  summary.session = session;
  // Counts in the index and reads two rows.
  Statement read(db,
                 "SELECT count(*), "
                 "  (SELECT receive_time_ns FROM segments WHERE rig = ?1 "
                 "    AND session = ?2 ORDER BY session_index LIMIT 1), "
                 "  (SELECT receive_time_ns FROM segments WHERE rig = ?1 "
                 "    AND session = ?2 ORDER BY session_index DESC LIMIT 1) "
                 "FROM segments WHERE rig = ?1 AND session = ?2",
                 rig,
                 session);
  if (read.Next()) {
    summary.segments = read.Int(0);
    summary.first_receive_ns = read.Int(1);
    summary.last_receive_ns = read.Int(2);
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return summary;
}

absl::StatusOr<std::vector<SessionSegment::Score>> ReadScores(
    Connection* db, std::int64_t rig, std::int64_t sequence) {
  Statement read(db,
                 "SELECT group_name, entropy, gain FROM segment_scores "
                 "WHERE rig = ?1 AND sequence = ?2 ORDER BY group_name",
                 rig,
                 sequence);
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  std::vector<SessionSegment::Score> scores;
  while (read.Next()) {
    scores.push_back({read.Text(0),
                      read.IsNull(1) ? kNone : read.Double(1),
                      read.IsNull(2) ? kNone : read.Double(2)});
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return scores;
}

// Empty if there is none or it is damaged; the check of the database tells them
// apart.
std::vector<PathPoint> PathFromRow(const Statement& row,
                                   int path,
                                   int sha256,
                                   const std::string& what) {
  if (row.IsNull(path)) return {};
  const std::string bytes = row.Text(path);
  if (!VerifySha256(bytes, row.Text(sha256), what).ok()) return {};
  return ParsePath(bytes, what).value_or(std::vector<PathPoint>());
}

}  // namespace

absl::StatusOr<Listed<SessionSummary>> ListSessionRows(Connection* db,
                                                       const std::string& rig,
                                                       const Page& page) {
  const std::string list = "sessions/" + rig;
  SELFCAL_ASSIGN_OR_RETURN(const auto key, PageKey(list, page));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  const int size = PageSize(page);
  Listed<SessionSummary> listed;
  std::string last = key.value_or("");
  while (static_cast<int>(listed.items.size()) <= size) {
    SELFCAL_ASSIGN_OR_RETURN(const auto next, NextSession(db, rig_id, last));
    if (!next) break;
    SELFCAL_ASSIGN_OR_RETURN(SessionSummary summary,
                             Summarise(db, rig_id, *next));
    listed.items.push_back(std::move(summary));
    last = *next;
  }
  CutPage(
      list,
      size,
      [](const SessionSummary& summary) { return summary.session; },
      &listed);
  return listed;
}

absl::StatusOr<SessionSummary> ReadSession(Connection* db,
                                           const std::string& rig,
                                           const std::string& session) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  SELFCAL_ASSIGN_OR_RETURN(SessionSummary summary,
                           Summarise(db, rig_id, session));
  if (summary.segments > 0) return summary;
  return absl::NotFoundError(
      fmt::format("nothing is kept of a session {} of rig {}", session, rig));
}

absl::StatusOr<Listed<SessionSegment>> ListSessionSegmentRows(
    Connection* db,
    const std::string& rig,
    const std::string& session,
    const Page& page) {
  const std::string list = fmt::format("session/{}/{}", rig, session);
  SELFCAL_ASSIGN_OR_RETURN(const auto key, PageNumber(list, page));
  SELFCAL_RETURN_IF_ERROR(ReadSession(db, rig, session).status());
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  const int size = PageSize(page);
  Statement read(db,
                 "SELECT s.sequence, s.session_index, s.state, s.start_ns, "
                 "  s.end_ns, p.path, p.sha256, EXISTS (SELECT 1 "
                 "    FROM payloads d "
                 "    WHERE d.rig = ?1 AND d.sequence = s.sequence) "
                 "FROM segments s "
                 "LEFT JOIN segment_paths p USING (rig, sequence) "
                 "WHERE s.rig = ?1 AND s.session = ?2 AND s.session_index > ?3 "
                 "ORDER BY s.session_index LIMIT ?4",
                 rig_id,
                 session,
                 key.value_or(-1),
                 size + 1);
  Listed<SessionSegment> listed;
  while (read.Next()) {
    SessionSegment segment;
    segment.key = {session, read.Int(1)};
    segment.state = static_cast<SegmentState>(read.Int(2));
    segment.start_ns = read.Int(3);
    segment.end_ns = read.Int(4);
    segment.path = PathFromRow(read, 5, 6, SegmentText(rig, segment.key));
    segment.has_data = read.Int(7) != 0;
    const std::int64_t sequence = read.Int(0);
    SELFCAL_ASSIGN_OR_RETURN(segment.scores, ReadScores(db, rig_id, sequence));
    SELFCAL_ASSIGN_OR_RETURN(segment.tables,
                             TablesOfSegment(db, rig_id, sequence));
    listed.items.push_back(std::move(segment));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  CutPage(
      list,
      size,
      [](const SessionSegment& segment) { return segment.key.index; },
      &listed);
  return listed;
}

}  // namespace selfcal::server
