// Conditions on the items of a list: "state = failed AND created >=
// 2026-11-21". The program tests them all, and has the daemon test those that
// it can.
#pragma once

#include <absl/status/statusor.h>
#include <google/protobuf/timestamp.pb.h>

#include <functional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace selfcal::client {

// A field of which conditions may be.
struct FilterField {
  enum class Kind {
    kText,    // = and !=; upper and lower case are the same
    kNumber,  // also < <= > >=
    kTime,    // as a number, written as ParseTime() reads it
  };
  std::string name;
  Kind kind = Kind::kText;
  // Values of a text, if no others exist. Spaces, '-' and '_' are the same.
  std::vector<std::string> known = {};
  // Its name in the filter of the daemon; empty: the daemon does not have it.
  std::string of_daemon = {};
};

// A text, or a number; a time is its seconds since 1970. NaN meets no condition
// but !=.
using FieldValue = std::variant<std::string, double>;

class ListFilter {
 public:
  // INVALID_ARGUMENT, with the known fields or values, if the text has others
  // or is not a list of conditions that AND joins. An empty text has none.
  static absl::StatusOr<ListFilter> Parse(
      std::string_view text,
      const std::vector<FilterField>& fields,
      const google::protobuf::Timestamp& now);

  // True if all conditions are met; `value` returns the value of a field.
  bool Meets(
      const std::function<FieldValue(std::string_view field)>& value) const;

  // Conditions that the daemon can test, in its words, which an item has to
  // meet among others; empty: none.
  std::string ForDaemon() const;

 private:
  struct Condition {
    std::string field;
    std::string of_daemon;
    std::string sign;
    FieldValue value;
    bool is_time = false;
  };
  std::vector<Condition> conditions_;
};

// Help for --filter: an example and the fields.
std::string FilterHelp(const std::string& example,
                       const std::vector<FilterField>& fields);

// Seconds since 1970, or NaN without a time.
double FilterTime(const google::protobuf::Timestamp& time);

}  // namespace selfcal::client
