#include "client/cli/list_filter.h"

#include <absl/strings/numbers.h>
#include <fmt/format.h>
#include <google/protobuf/util/time_util.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "client/cli/time_input.h"
#include "proto/nearest_word.h"

namespace selfcal::client {
namespace {

constexpr std::string_view kSpace = " \t\r\n";
constexpr std::string_view kSigns = "<>=!";

absl::Status Refused(const std::string& what) {
  return absl::InvalidArgumentError("--filter: " + what);
}

std::string Choices(const std::vector<std::string>& words) {
  return fmt::format("{}", fmt::join(words, ", "));
}

std::vector<std::string> NamesOf(const std::vector<FilterField>& fields) {
  std::vector<std::string> names;
  for (const FilterField& field : fields) names.push_back(field.name);
  return names;
}

// One spelling for "Tables full", "TABLES_FULL" and "tables-full".
std::string Plain(std::string_view text) {
  std::string plain(text);
  for (char& c : plain) {
    c = c == ' ' || c == '_'
            ? '-'
            : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return plain;
}

// Takes words, quoted texts and signs from the begin of a text.
class Tokens {
 public:
  explicit Tokens(std::string_view text) : rest_(text) { SkipSpace(); }

  bool at_end() const { return rest_.empty(); }

  // Empty if there is none.
  std::string Sign() {
    for (const std::string_view sign : {"<=", ">=", "!=", "<", ">", "="}) {
      if (rest_.starts_with(sign)) return Take(sign.size());
    }
    return "";
  }

  // A word up to a space or a sign, or a text in quotes; empty if there is
  // none.
  std::string Word() {
    if (rest_.starts_with('"')) {
      const std::size_t end = rest_.find('"', 1);
      if (end == rest_.npos) return "";
      std::string text = Take(end + 1);
      return text.substr(1, text.size() - 2);
    }
    const std::string ends = std::string(kSpace) + std::string(kSigns);
    return Take(std::min(rest_.find_first_of(ends), rest_.size()));
  }

 private:
  std::string Take(std::size_t count) {
    std::string taken(rest_.substr(0, count));
    rest_.remove_prefix(count);
    SkipSpace();
    return taken;
  }

  void SkipSpace() {
    rest_.remove_prefix(
        std::min(rest_.find_first_not_of(kSpace), rest_.size()));
  }

  std::string_view rest_;
};

absl::StatusOr<FieldValue> ReadValue(const FilterField& field,
                                     const std::string& text,
                                     const google::protobuf::Timestamp& now) {
  if (field.kind == FilterField::Kind::kNumber) {
    double number = 0;
    if (absl::SimpleAtod(text, &number)) return FieldValue(number);
    return Refused(
        fmt::format("'{}' is not a number, as {} is", text, field.name));
  }
  if (field.kind == FilterField::Kind::kTime) {
    const auto time = ParseTime(text, now);
    if (time.ok()) return FieldValue(FilterTime(*time));
    return Refused(fmt::format(
        "{}: {}", field.name, std::string(time.status().message())));
  }
  std::string plain = Plain(text);
  const auto is_meant = [&plain](const std::string& one) {
    return Plain(one) == plain;
  };
  if (field.known.empty() ||
      std::any_of(field.known.begin(), field.known.end(), is_meant)) {
    return FieldValue(std::move(plain));
  }
  return Refused(fmt::format("there is no {} '{}'{}\n  Known: {}",
                             field.name,
                             text,
                             DidYouMean(text, field.known),
                             Choices(field.known)));
}

template <typename T>
bool Compare(const T& a, const std::string& sign, const T& b) {
  if (sign == "=") return a == b;
  if (sign == "!=") return a != b;
  if (sign == "<") return a < b;
  if (sign == "<=") return a <= b;
  return sign == ">" ? a > b : a >= b;
}

// The name of an enumerator: ROLLED_BACK of rolled-back.
std::string DaemonWord(std::string plain) {
  for (char& c : plain) {
    c = c == '-'
            ? '_'
            : static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  }
  return plain;
}

// The whole second before or after the time, so that no item is excluded by
// rounding; empty for a time that is compared for equality.
std::string DaemonTime(const std::string& sign, double seconds) {
  if (sign == "=") return "";
  const double whole =
      sign.starts_with("<") ? std::ceil(seconds) : std::floor(seconds);
  return google::protobuf::util::TimeUtil::ToString(
      google::protobuf::util::TimeUtil::SecondsToTimestamp(
          static_cast<std::int64_t>(whole)));
}

}  // namespace

absl::StatusOr<ListFilter> ListFilter::Parse(
    std::string_view text,
    const std::vector<FilterField>& fields,
    const google::protobuf::Timestamp& now) {
  ListFilter filter;
  Tokens tokens(text);
  while (!tokens.at_end()) {
    if (!filter.conditions_.empty()) {
      const std::string joint = tokens.Word();
      if (joint != "AND" || tokens.at_end()) {
        return Refused("conditions must be joined by AND");
      }
    }
    const std::string name = tokens.Word();
    const auto field = std::find_if(
        fields.begin(), fields.end(), [&name](const FilterField& one) {
          return one.name == name;
        });
    if (field == fields.end()) {
      return Refused(fmt::format("there is no field '{}'{}\n  Known: {}",
                                 name,
                                 DidYouMean(name, NamesOf(fields)),
                                 Choices(NamesOf(fields))));
    }
    const std::string sign = tokens.Sign();
    const bool is_text = field->kind == FilterField::Kind::kText;
    if (sign.empty() || (is_text && sign != "=" && sign != "!=")) {
      return Refused(fmt::format("after {} must follow one of {}",
                                 name,
                                 is_text ? "= !=" : "= != < <= > >="));
    }
    const std::string word = tokens.Word();
    if (word.empty()) {
      return Refused(fmt::format("{} {} needs a value", name, sign));
    }
    auto value = ReadValue(*field, word, now);
    if (!value.ok()) return value.status();
    filter.conditions_.push_back({name,
                                  field->of_daemon,
                                  sign,
                                  *std::move(value),
                                  field->kind == FilterField::Kind::kTime});
  }
  return filter;
}

bool ListFilter::Meets(
    const std::function<FieldValue(std::string_view field)>& value) const {
  return std::all_of(
      conditions_.begin(), conditions_.end(), [&value](const Condition& one) {
        const FieldValue is = value(one.field);
        const auto* const number = std::get_if<double>(&is);
        return number != nullptr
                   ? Compare(*number, one.sign, std::get<double>(one.value))
                   : Compare(Plain(std::get<std::string>(is)),
                             one.sign,
                             std::get<std::string>(one.value));
      });
}

std::string ListFilter::ForDaemon() const {
  std::vector<std::string> terms;
  for (const Condition& one : conditions_) {
    if (one.of_daemon.empty() || one.sign == "!=") continue;
    const auto* const number = std::get_if<double>(&one.value);
    std::string value;
    if (number == nullptr) {
      value = DaemonWord(std::get<std::string>(one.value));
    } else if (one.is_time) {
      value = DaemonTime(one.sign, *number);
    } else {
      value = fmt::format("{}", *number);
    }
    if (value.empty()) continue;
    terms.push_back(fmt::format("{} {} {}", one.of_daemon, one.sign, value));
  }
  return fmt::format("{}", fmt::join(terms, " AND "));
}

std::string FilterHelp(const std::string& example,
                       const std::vector<FilterField>& fields) {
  return fmt::format("Conditions joined by AND, e.g. '{}'; fields: {}",
                     example,
                     Choices(NamesOf(fields)));
}

double FilterTime(const google::protobuf::Timestamp& time) {
  if (time.seconds() == 0) return std::numeric_limits<double>::quiet_NaN();
  return static_cast<double>(time.seconds()) + 1e-9 * time.nanos();
}

}  // namespace selfcal::client
