// The tables whose rows a device reports to its hub: all but what concerns only
// the computations of the device (segment_ends), its clock, claims, and events
// without a rig.
#pragma once

#include <string_view>
#include <vector>

#include "server/store/record_kind.h"

namespace selfcal::server {

enum class ColumnType { kInteger, kReal, kText, kBlob };

struct ReportedColumn {
  std::string_view name;
  ColumnType type;
};

struct ReportedTable {
  std::string_view name;
  RecordKind kind;
  // The column with the number of the record; empty: its kind has one record.
  std::string_view number;
  // The columns, besides the rig and the number, that identify a row of the
  // record.
  std::vector<std::string_view> key;
  // All columns but the rig and the number.
  std::vector<ReportedColumn> columns;
};

// Each before what refers to it.
const std::vector<ReportedTable>& ReportedTables();

}  // namespace selfcal::server
