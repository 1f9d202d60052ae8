#include "client/cli/usage_errors.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>

#include "client/cli/context.h"
#include "client/cli/old_spellings.h"
#include "proto/nearest_word.h"

namespace selfcal::client {
namespace {

// Words of other programs for commands of this one.
const std::map<std::string, std::string>& OtherWords() {
  static const auto& words = *new std::map<std::string, std::string>{
      {"abort", "cancel"},        {"add", "create"},
      {"describe", "show"},       {"edit", "update"},
      {"follow", "watch"},        {"get", "show"},
      {"info", "show"},           {"ls", "list"},
      {"new", "create"},          {"remove", "delete"},
      {"rm", "delete"},           {"rollback", "activate"},
      {"set", "update"},          {"stop", "cancel"},
      {"calibrate", "run start"}, {"check", "preflight"},
      {"log", "event list"},      {"logs", "event list"},
      {"ps", "daemon top"},       {"send", "segment import"},
      {"status", "daemon top"},   {"upload", "segment import"}};
  return words;
}

std::vector<std::string> NamesOf(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::App* one : ShownCommands(command)) {
    names.push_back(one->get_name());
  }
  return names;
}

// The words that lead to a command, with the program.
std::string PathOf(const CLI::App& command) {
  const CLI::App* const parent = command.get_parent();
  return parent == nullptr ? command.get_name()
                           : PathOf(*parent) + " " + command.get_name();
}

// The last command of the line.
const CLI::App& GivenCommand(const CLI::App& app) {
  const CLI::App* at = &app;
  while (!at->get_subcommands().empty()) at = at->get_subcommands().back();
  return *at;
}

// The flags that may follow a command.
std::vector<std::string> FlagsFor(const CLI::App& command) {
  std::vector<std::string> flags;
  for (const CLI::App* at = &command; at != nullptr; at = at->get_parent()) {
    for (const CLI::Option* option :
         at->get_options([](const CLI::Option*) { return true; })) {
      for (const std::string& name : option->get_lnames()) {
        flags.push_back("--" + name);
      }
    }
  }
  return flags;
}

// The nouns that have a command of this name, e.g. "selfcal rig list".
std::vector<std::string> WithVerb(const CLI::App& app,
                                  const std::string& verb) {
  std::vector<std::string> paths;
  for (const CLI::App* noun : ShownCommands(app)) {
    for (const CLI::App* command : ShownCommands(*noun)) {
      if (command->get_name() == verb) paths.push_back(PathOf(*command));
    }
  }
  return paths;
}

// Returns the commands that a word which is no noun may mean; empty if unknown.
std::vector<std::string> MeantByNoun(const CLI::App& app,
                                     const std::string& word) {
  const auto other = OtherWords().find(word);
  const std::string plain = other == OtherWords().end() ? word : other->second;
  if (plain.find(' ') != plain.npos) return {"selfcal " + plain};
  if (auto paths = WithVerb(app, plain); !paths.empty()) return paths;
  std::map<std::string, std::string> meanings = OldSpellings();
  for (const CLI::App* noun : ShownCommands(app)) {
    meanings[noun->get_name()] = noun->get_name();
    for (const std::string& alias : noun->get_aliases()) {
      meanings[alias] = noun->get_name();
    }
  }
  std::vector<std::string> known;
  for (const auto& [spelling, meaning] : meanings) known.push_back(spelling);
  const std::string nearest = NearestWord(word, known);
  if (!nearest.empty()) return {"selfcal " + meanings.at(nearest)};
  std::vector<std::string> verbs;
  for (const CLI::App* noun : ShownCommands(app)) {
    for (std::string& verb : NamesOf(*noun)) verbs.push_back(std::move(verb));
  }
  return WithVerb(app, NearestWord(word, verbs));
}

std::vector<std::string> MeantByVerb(const CLI::App& noun,
                                     const std::string& word) {
  const auto known = NamesOf(noun);
  const auto other = OtherWords().find(word);
  const bool has_other =
      other != OtherWords().end() &&
      std::find(known.begin(), known.end(), other->second) != known.end();
  const std::string meant =
      has_other ? other->second : NearestWord(word, known);
  if (meant.empty()) return {};
  return {PathOf(noun) + " " + meant};
}

std::string UnknownCommand(const CLI::App& command, const std::string& word) {
  const bool is_noun = command.get_parent() == nullptr;
  const auto meant =
      is_noun ? MeantByNoun(command, word) : MeantByVerb(command, word);
  std::string text =
      fmt::format("'{}' has no command '{}'", PathOf(command), word);
  if (meant.size() == 1) {
    text += fmt::format("; did you mean '{}'?", meant.front());
  } else if (!meant.empty()) {
    text += fmt::format("; did you mean one of these?\n  {}",
                        fmt::join(meant, "\n  "));
  }
  return text +
         fmt::format("\n  Commands: {}", fmt::join(NamesOf(command), ", "));
}

// E.g. "Usage: selfcal rig show [OPTIONS] RIG".
std::string UsageLine(const CLI::App& command) {
  const auto formatter =
      std::dynamic_pointer_cast<CLI::Formatter>(command.get_formatter());
  std::string line = formatter->make_usage(&command, PathOf(command));
  line.erase(line.find_last_not_of('\n') + 1);
  return fmt::format("\n  {}\n  See '{} --help'.", line, PathOf(command));
}

std::string UnknownWord(const CLI::App& command,
                        const std::vector<std::string>& words) {
  const auto flag =
      std::find_if(words.begin(), words.end(), [](const std::string& word) {
        return word.size() > 1 && word.front() == '-';
      });
  if (flag != words.end()) {
    const std::string name = flag->substr(0, flag->find('='));
    return fmt::format("'{}' has no flag '{}'{}\n  See '{} --help'.",
                       PathOf(command),
                       name,
                       DidYouMean(name, FlagsFor(command)),
                       PathOf(command));
  }
  const std::string& word = words.front();
  if (!ShownCommands(command).empty()) return UnknownCommand(command, word);
  return fmt::format("'{}' was not expected", word) + UsageLine(command);
}

// Returns the message for an error of the parser other than an unknown word.
std::string OtherMistake(const CLI::App& command,
                         const CLI::ParseError& error) {
  const auto commands = NamesOf(command);
  if (!commands.empty() && error.get_name() == "RequiredError") {
    return fmt::format("'{}' needs a command: {}\n  See '{} --help'.",
                       PathOf(command),
                       fmt::join(commands, ", "),
                       PathOf(command));
  }
  const std::string what = error.what();
  std::string text = what + UsageLine(command);
  if (what.starts_with("RIG ")) {
    text += "\n  'selfcal rig list' lists the rigs.";
  }
  return text;
}

}  // namespace

std::vector<const CLI::App*> ShownCommands(const CLI::App& command) {
  return command.get_subcommands(
      [](const CLI::App* one) { return !one->get_group().empty(); });
}

int ReportUsage(CLI::App* app, const CLI::ParseError& error) {
  if (error.get_exit_code() == 0) {
    app->exit(error);
    return kDone;
  }
  const CLI::App& command = GivenCommand(*app);
  const auto words = app->remaining(/*recurse=*/true);
  if (!words.empty()) {
    PrintError(UnknownWord(command, words));
  } else if (&command == app && error.get_name() == "RequiredError") {
    PrintError("a command is missing\n\n" + app->help());
  } else {
    PrintError(OtherMistake(command, error));
  }
  return kUsage;
}

int ShowHelp(const CLI::App& app, const std::vector<std::string>& words) {
  const CLI::App* at = &app;
  for (const std::string& word : words) {
    const auto next = at->get_subcommands(
        [&word](const CLI::App* one) { return one->check_name(word); });
    if (next.empty()) {
      PrintError(UnknownCommand(*at, word));
      return kUsage;
    }
    at = next.front();
  }
  PrintText(at->get_formatter()->make_help(
      at, PathOf(*at), CLI::AppFormatMode::Normal));
  return kDone;
}

}  // namespace selfcal::client
