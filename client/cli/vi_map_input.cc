#include "client/cli/vi_map_input.h"

#include <fmt/format.h>

#include <utility>

#include "client/cli/positive_number.h"

namespace selfcal::client {

void AddViMapOptions(CLI::App* command, ViMapInput* input) {
  SegmentBuilderOptions& builder = input->builder;
  command
      ->add_option("DIR",
                   input->folders,
                   "A VI-map, or a folder of submap_0, submap_1, ...; several "
                   "must be consecutive, and become one session")
      ->required();
  command->add_option("--keyframes", builder.keyframes, "Keyframes per segment")
      ->check(CLI::Range(2, 2000))
      ->capture_default_str();
  command
      ->add_option(
          "--seconds", builder.seconds, "Close segments by time instead [s]")
      ->check(AboveZero());
  command
      ->add_option("--min-observations",
                   builder.min_observations,
                   "Exclude landmarks with fewer observations in a segment")
      ->capture_default_str();
  command->add_flag("--all-landmarks",
                    input->all_landmarks,
                    "Also use landmarks that the map does not mark as good");
}

absl::StatusOr<ViMapSegments> ReadViMapSegments(const ViMapInput& input) {
  ViMapOptions options;
  options.good_landmarks_only = !input.all_landmarks;
  absl::StatusOr<ViMapRecording> recording =
      input.folders.size() == 1 ? ReadViMap(input.folders.front(), options)
                                : ReadViMaps(input.folders, options);
  if (!recording.ok()) return recording.status();
  SegmentBuilderOptions builder = input.builder;
  if (builder.session.empty()) builder.session = recording->session;
  ViMapSegments result;
  result.segments = BuildSegments(*recording, builder);
  result.rig = std::move(recording->rig);
  if (result.segments.empty()) {
    return absl::InvalidArgumentError(
        fmt::format("{} is too short for one segment; give fewer --keyframes",
                    input.folders.front()));
  }
  return result;
}

}  // namespace selfcal::client
