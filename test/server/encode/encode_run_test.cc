#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "server/encode/encode.h"

namespace selfcal::server {
namespace {

using v1::Recalibration;

TEST(EncodeRun, EveryTriggerIsThatOfTheContract) {
  const std::vector<std::pair<RunTrigger, Recalibration::Trigger>> triggers = {
      {RunTrigger::kTablesFull, Recalibration::TABLES_FULL},
      {RunTrigger::kTablesChanged, Recalibration::TABLES_CHANGED},
      {RunTrigger::kManual, Recalibration::MANUAL},
      {RunTrigger::kChangeDetected, Recalibration::CHANGE_DETECTED},
      {RunTrigger::kCalibrationAged, Recalibration::CALIBRATION_AGED},
      {RunTrigger::kSessionEnded, Recalibration::SESSION_ENDED}};
  for (const auto& [stored, expected] : triggers) {
    StoredRun run;
    run.rig = "a";
    run.run = 1;
    run.trigger = stored;
    EXPECT_EQ(Encode(run, {}, nullptr).trigger(), expected);
  }
  // The contract has one more: not known.
  EXPECT_EQ(std::ssize(triggers),
            Recalibration::Trigger_descriptor()->value_count() - 1);
}

}  // namespace
}  // namespace selfcal::server
