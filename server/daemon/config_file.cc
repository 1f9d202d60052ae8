#include "server/daemon/config_file.h"

#include <absl/status/statusor.h>
#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>
#include <vector>

#include "proto/nearest_word.h"
#include "server/daemon/settings.h"

namespace selfcal::server {
namespace {

absl::Status FileMistake(const std::string& path,
                         const toml::source_region& where,
                         const std::string& what) {
  return absl::InvalidArgumentError(fmt::format(
      "{}:{}:{}: {}", path, where.begin.line, where.begin.column, what));
}

absl::StatusOr<std::string> ReadFile(const std::string& path) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(
      std::fopen(path.c_str(), "rb"), std::fclose);
  std::string text;
  if (file != nullptr) {
    std::array<char, 4096> buffer{};
    while (const std::size_t size =
               std::fread(buffer.data(), 1, buffer.size(), file.get())) {
      text.append(buffer.data(), size);
    }
    if (std::ferror(file.get()) == 0) return text;
  }
  return absl::NotFoundError(
      fmt::format("cannot read {}: {}", path, std::strerror(errno)));
}

// Converts a value to the text of a command line argument; nullopt for types
// that no setting has.
std::optional<std::string> Text(const toml::node& node) {
  if (const auto* text = node.as_string()) return text->get();
  if (const auto* number = node.as_integer()) {
    return fmt::format("{}", number->get());
  }
  if (const auto* number = node.as_floating_point()) {
    return fmt::format("{}", number->get());
  }
  if (const auto* flag = node.as_boolean()) {
    return flag->get() ? "true" : "false";
  }
  return std::nullopt;
}

std::optional<std::vector<std::string>> Texts(const toml::node& node) {
  std::vector<std::string> texts;
  const auto add = [&](const toml::node& one) {
    const auto text = Text(one);
    if (text && !text->empty()) texts.push_back(*text);
    return text.has_value();
  };
  if (const auto* list = node.as_array()) {
    const bool all = std::all_of(list->begin(), list->end(), add);
    return all ? std::optional(texts) : std::nullopt;
  }
  return add(node) ? std::optional(texts) : std::nullopt;
}

std::string WrongKind(const std::string& name) {
  return "'" + name + "' must be a string, a number or a list of strings";
}

std::vector<std::string> SettingsOf(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    names.push_back(option->get_single_name());
  }
  return names;
}

// Applies a value; returns an error message, or nullopt if it is valid.
std::optional<std::string> Set(const std::string& name,
                               bool is_flag,
                               const std::vector<std::string>& values,
                               DaemonOptions* options) {
  CLI::App app;
  app.set_help_flag();  // the help flag is not a setting
  DefineSettings(&app, Environment::kIgnore, options);
  if (app.get_option_no_throw("--" + name) == nullptr) {
    const std::string meant = DidYouMean(name, SettingsOf(app));
    return "there is no setting '" + name + "'" +
           (meant.empty() ? ";" : meant) + " selfcald --help lists them";
  }
  const bool takes_flag =
      app.get_option("--" + name)->get_items_expected_max() == 0;
  if (takes_flag && !is_flag) return "'" + name + "' must be true or false";
  if (!takes_flag && is_flag) return WrongKind(name);
  std::vector<std::string> arguments;
  for (const std::string& value : values) {
    arguments.push_back("--" + name + "=" + value);
  }
  try {
    // CLI11 expects arguments in reverse order.
    std::reverse(arguments.begin(), arguments.end());
    app.parse(arguments);
  } catch (const CLI::ParseError& error) {
    return error.what();
  }
  return std::nullopt;
}

}  // namespace

absl::Status ApplyConfigFile(const std::string& path, DaemonOptions* options) {
  const auto text = ReadFile(path);
  if (!text.ok()) return text.status();
  toml::table table;
  try {
    table = toml::parse(*text, path);
  } catch (const toml::parse_error& error) {
    return FileMistake(path, error.source(), std::string(error.description()));
  }
  for (const auto& [key, node] : table) {
    const std::string name(key.str());
    const auto values = Texts(node);
    if (!values) {
      return FileMistake(path, key.source(), WrongKind(name));
    }
    if (const auto wrong = Set(name, node.is_boolean(), *values, options)) {
      return FileMistake(path, key.source(), *wrong);
    }
  }
  return absl::OkStatus();
}

}  // namespace selfcal::server
