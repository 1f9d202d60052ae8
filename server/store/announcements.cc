#include "server/store/announcements.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_split.h>
#include <fmt/format.h>

#include <vector>

#include "server/store/driver/driver.h"

namespace selfcal::server {
namespace {

constexpr char kCalibration[] = "calibration";
constexpr char kRun[] = "run";
constexpr char kDeletion[] = "deletion";

}  // namespace

absl::Status AnnounceCalibration(UnitOfWork* tx) {
  return tx->db()->Announce(fmt::format("{} {}", kCalibration, tx->rig()));
}

absl::Status AnnounceRun(UnitOfWork* tx, std::int64_t run) {
  return tx->db()->Announce(fmt::format("{} {} {}", kRun, tx->rig(), run));
}

absl::Status AnnounceDeletion(UnitOfWork* tx) {
  return tx->db()->Announce(fmt::format("{} {}", kDeletion, tx->rig()));
}

std::optional<Announcement> ParseAnnouncement(
    const std::optional<std::string>& text) {
  if (!text) return Announcement{};
  const std::vector<std::string> words = absl::StrSplit(*text, ' ');
  if (words.size() == 2 && words[0] == kCalibration) {
    return Announcement{Announcement::Kind::kCalibration, words[1]};
  }
  if (words.size() == 2 && words[0] == kDeletion) {
    return Announcement{Announcement::Kind::kDeletion, words[1]};
  }
  std::int64_t run = 0;
  if (words.size() == 3 && words[0] == kRun &&
      absl::SimpleAtoi(words[2], &run)) {
    return Announcement{Announcement::Kind::kRun, words[1], run};
  }
  return std::nullopt;
}

}  // namespace selfcal::server
