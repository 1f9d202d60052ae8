// Records of exclusions: why a table does not hold a scored segment. Exclusion
// is in session.h.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/store/exclusion_cause.h"
#include "server/store/session.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Exclusions of a segment, in the order of the rig's groups. NOT_FOUND if there
// is no such segment.
absl::StatusOr<std::vector<Exclusion>> ListExclusionRows(Connection* db,
                                                         const std::string& rig,
                                                         const SegmentKey& key);

// A set of causes, as a parameter of queries.
class ExclusionCauses {
 public:
  constexpr ExclusionCauses(std::initializer_list<ExclusionCause> causes) {
    for (const ExclusionCause cause : causes) {
      bits_ |= std::int64_t{1} << static_cast<int>(cause);
    }
  }
  // The bit of a cause is that of its number.
  constexpr std::int64_t bits() const { return bits_; }

 private:
  std::int64_t bits_ = 0;
};

// SQL condition on a row `s` of segments: a table does not hold the segment for
// one of the causes whose bits are the value of this parameter ("?1").
std::string ExcludedFor(std::string_view parameter);

// --- Within a unit of work.

// An exclusion to write. It replaces an earlier one of the same segment and
// group; its time is that of the unit of work.
struct NewExclusion {
  ExclusionCause cause = ExclusionCause::kInsufficientGain;
  std::optional<std::int64_t> rival = std::nullopt;  // its sequence
  std::optional<double> rival_entropy = std::nullopt;
  std::optional<double> fit = std::nullopt;
  std::optional<double> fit_limit = std::nullopt;
};
absl::Status WriteExclusion(UnitOfWork* tx,
                            std::int64_t sequence,
                            const std::string& group,
                            const NewExclusion& exclusion);

}  // namespace selfcal::server
