#include "server/encode/filter_terms.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "proto/safe_text.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

constexpr std::size_t kMaxFilter = 4000;

bool IsOfWord(char c) {
  return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') ||
         (c >= 'a' && c <= 'z') ||
         std::string_view("_-+.:~").find(c) != std::string_view::npos;
}

// A tokeniser: words, quoted texts and comparisons.
class Words {
 public:
  explicit Words(std::string_view text) : rest_(text) { SkipSpace(); }

  bool at_end() const { return rest_.empty(); }
  bool at_comparison() const {
    return !rest_.empty() && std::string_view("<>=").find(rest_.front()) !=
                                 std::string_view::npos;
  }

  absl::StatusOr<std::string> Word(std::string_view expected) {
    if (!rest_.empty() && rest_.front() == '"') return Quoted();
    const auto end = std::find_if_not(rest_.begin(), rest_.end(), IsOfWord);
    std::string word(rest_.begin(), end);
    if (word.empty()) {
      return NotWhatIsExpected(rest_.empty() ? "the end" : rest_, expected);
    }
    rest_.remove_prefix(word.size());
    SkipSpace();
    return word;
  }

  absl::StatusOr<std::string> Comparison() {
    for (const std::string_view sign : {"<=", ">=", "<", ">", "="}) {
      if (!rest_.starts_with(sign)) continue;
      rest_.remove_prefix(sign.size());
      SkipSpace();
      return std::string(sign);
    }
    return NotWhatIsExpected(rest_.empty() ? "the end" : rest_,
                             "one of = < <= > >=");
  }

 private:
  void SkipSpace() {
    rest_.remove_prefix(
        std::min(rest_.find_first_not_of(" \t\r\n"), rest_.size()));
  }

  absl::StatusOr<std::string> Quoted() {
    std::string text;
    for (std::size_t k = 1; k < rest_.size(); ++k) {
      if (rest_[k] == '"') {
        rest_.remove_prefix(k + 1);
        SkipSpace();
        return text;
      }
      if (rest_[k] == '\\' && k + 1 < rest_.size()) ++k;
      text += rest_[k];
    }
    return NotWhatIsExpected(rest_, "closed by a quote");
  }

  std::string_view rest_;
};

absl::StatusOr<FilterTerm> NextTerm(Words* words, LoneTexts lone_texts) {
  FilterTerm term;
  SELFCAL_ASSIGN_OR_RETURN(term.field, words->Word("a field"));
  if (lone_texts == LoneTexts::kAllowed && !words->at_comparison()) {
    term.value = std::move(term.field);
    term.field.clear();
    return term;
  }
  SELFCAL_ASSIGN_OR_RETURN(term.sign, words->Comparison());
  SELFCAL_ASSIGN_OR_RETURN(term.value, words->Word("a value"));
  const auto dot = term.field.find('.');
  if (dot != std::string::npos) {
    term.group = term.field.substr(dot + 1);
    term.field.resize(dot);
  }
  return term;
}

}  // namespace

absl::Status NotWhatIsExpected(std::string_view what,
                               std::string_view expected) {
  return absl::InvalidArgumentError(
      fmt::format("'{}' is not {}", SafeLine(what, kMaxTermShown), expected));
}

absl::Status ForEachTerm(
    std::string_view filter,
    LoneTexts lone_texts,
    const std::function<absl::Status(const FilterTerm& term)>& apply) {
  if (filter.size() > kMaxFilter) {
    return absl::InvalidArgumentError(
        fmt::format("is longer than {} characters", kMaxFilter));
  }
  Words words(filter);
  while (!words.at_end()) {
    SELFCAL_ASSIGN_OR_RETURN(const FilterTerm term,
                             NextTerm(&words, lone_texts));
    SELFCAL_RETURN_IF_ERROR(apply(term));
    if (words.at_end()) break;
    SELFCAL_ASSIGN_OR_RETURN(const std::string joint, words.Word("AND"));
    if (joint != "AND") {
      return NotWhatIsExpected(joint, "AND between two conditions");
    }
    if (words.at_end()) return NotWhatIsExpected("the end", "a condition");
  }
  return absl::OkStatus();
}

absl::StatusOr<ListOrder> ParseOrder(std::string_view order_by,
                                     std::string_view direction) {
  Words words(order_by);
  ListOrder order;
  SELFCAL_ASSIGN_OR_RETURN(order.field, words.Word("a field"));
  std::string way(direction);
  if (!words.at_end()) {
    SELFCAL_ASSIGN_OR_RETURN(way, words.Word("asc or desc"));
  }
  if ((way != "asc" && way != "desc") || !words.at_end()) {
    return NotWhatIsExpected(order_by, "one field, then asc or desc");
  }
  order.descending = way == "desc";
  return order;
}

}  // namespace selfcal::server
