// A list of the contract as CSV (RFC 4180), for spreadsheets and data frames.
#pragma once

#include <google/protobuf/message.h>

#include <string>

namespace selfcal::client {

// A header and one row for each item of the first repeated field of `list`. The
// columns are the fields of an item by their names in the contract, those of a
// message within it as `field.name`, and of a map or of messages that begin
// with a name of their own as `field.key` and `field.key.name`; other repeated
// fields are JSON. Numbers are exact, times RFC 3339 in UTC; what is not set is
// empty. A text that a spreadsheet would compute, because it begins with one of
// =+-@, begins with an apostrophe.
std::string ListCsv(const google::protobuf::Message& list);

}  // namespace selfcal::client
