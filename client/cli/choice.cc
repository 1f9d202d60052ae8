#include "client/cli/choice.h"

#include <fmt/format.h>

#include <algorithm>

#include "proto/nearest_word.h"

namespace selfcal::client {

CLI::Validator OneOf(const std::vector<std::string>& words) {
  const std::string choices = fmt::format("{}", fmt::join(words, ", "));
  return CLI::Validator(
      [words, choices](const std::string& word) -> std::string {
        if (std::find(words.begin(), words.end(), word) != words.end()) {
          return "";
        }
        return fmt::format(
            "'{}' is not one of {}{}", word, choices, DidYouMean(word, words));
      },
      "one of " + choices);
}

}  // namespace selfcal::client
