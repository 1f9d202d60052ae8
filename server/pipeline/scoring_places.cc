#include "server/pipeline/scoring_places.h"

namespace selfcal::server {

void ScoringPlaces::Open(const std::map<std::string, int>& filled) {
  const std::lock_guard lock(mutex_);
  filled_ = {filled.begin(), filled.end()};
  backlog_.Open(filled);
}

void ScoringPlaces::Fill(const std::string& rig) {
  const std::lock_guard lock(mutex_);
  ++filled_[rig];
}

void ScoringPlaces::Empty(const std::string& rig, int places) {
  const std::lock_guard lock(mutex_);
  EmptyLocked(rig, places);
}

std::vector<std::string> ScoringPlaces::FilledRigs() const {
  std::vector<std::string> rigs;
  const std::lock_guard lock(mutex_);
  for (const auto& [rig, places] : filled_) rigs.push_back(rig);
  return rigs;
}

void ScoringPlaces::EmptyAllBut(const std::string& rig, std::int64_t unscored) {
  const std::lock_guard lock(mutex_);
  const auto filled = filled_.find(rig);
  if (filled == filled_.end() || filled->second <= unscored) return;
  EmptyLocked(rig, filled->second - unscored);
}

void ScoringPlaces::EmptyLocked(const std::string& rig, std::int64_t places) {
  backlog_.Return(rig, static_cast<int>(places));
  const auto filled = filled_.find(rig);
  if (filled == filled_.end()) return;
  filled->second -= places;
  if (filled->second <= 0) filled_.erase(filled);
}

}  // namespace selfcal::server
