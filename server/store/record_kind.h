// Kinds of the records that a device reports to its hub.
#pragma once

namespace selfcal::server {

// The numbers are stored and sent: only ever extended. What was written in one
// transaction is reported in the order of these numbers, in which none refers
// to a later one.
enum class RecordKind {
  kRig = 1,      // definition and labels
  kTables = 2,   // of the groups, without their entries
  kSegment = 3,  // with its information, path, table entries and exclusions
  kRun = 4,
  kCalibration = 5,  // with its origin and its validation
  kActivation = 6,
  kChange = 7,
  kEvent = 8,
  kData = 9,  // of a segment
  // Which segments there are: others are gone. Follows after all records were
  // reported anew.
  kInventory = 10,
};

}  // namespace selfcal::server
