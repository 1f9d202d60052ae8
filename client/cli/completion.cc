#include "client/cli/completion.h"

#include <fmt/format.h>

#include <functional>
#include <memory>
#include <vector>

#include "client/cli/commands.h"
#include "client/cli/context.h"

namespace selfcal::client {
namespace {

std::vector<const CLI::App*> CommandsOf(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

// Returns the flags of a command, without those of the program, e.g.
// "--json --target ...".
std::vector<std::string> FlagsOf(const CLI::App& app) {
  std::vector<std::string> flags;
  for (const CLI::Option* option :
       app.get_options([](const CLI::Option*) { return true; })) {
    for (const std::string& name : option->get_lnames()) {
      flags.push_back("--" + name);
    }
  }
  return flags;
}

// Callback for each command, with the words that lead to it.
using Visit =
    std::function<void(const std::string& path, const CLI::App& command)>;
void ForEachCommand(const CLI::App& app,
                    const std::string& path,
                    const Visit& visit) {
  visit(path, app);
  for (const CLI::App* command : CommandsOf(app)) {
    ForEachCommand(
        *command,
        path.empty() ? command->get_name() : path + " " + command->get_name(),
        visit);
  }
}

// Puts the text into single quotes for a shell.
std::string Quoted(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? "'\\''" : std::string(1, c);
  return quoted + "'";
}

}  // namespace

std::string BashCompletion(const CLI::App& app) {
  std::string paths;
  std::string words;
  ForEachCommand(app, "", [&](const std::string& path, const CLI::App& at) {
    std::string here;
    for (const CLI::App* command : CommandsOf(at)) {
      here += command->get_name() + " ";
      paths += fmt::format("      '{} {}') path=\"$path $word\" ;;\n",
                           path.empty() ? "" : " " + path,
                           command->get_name());
    }
    for (const std::string& flag : FlagsOf(at)) here += flag + " ";
    words += fmt::format("    '{}') words={} ;;\n",
                         path.empty() ? "" : " " + path,
                         Quoted(here));
  });
  std::string global;
  for (const std::string& flag : FlagsOf(app)) global += flag + " ";
  return fmt::format(
      R"(_selfcal() {{
  local path='' word words=''
  for word in "${{COMP_WORDS[@]:1:COMP_CWORD-1}}"; do
    case "$path $word" in
{}    esac
  done
  case "$path" in
{}  esac
  COMPREPLY=($(compgen -W "$words {}" -- "${{COMP_WORDS[COMP_CWORD]}}"))
}}
complete -o default -F _selfcal selfcal
)",
      paths,
      words,
      global);
}

// Sourced, or from a file _selfcal in the fpath: then it is the function of its
// own name, and completes at once.
std::string ZshCompletion(const CLI::App& app) {
  return "#compdef selfcal\n"
         "(( $+functions[compdef] )) || { autoload -U +X compinit && compinit "
         "}\n"
         "autoload -U +X bashcompinit && bashcompinit\n" +
         BashCompletion(app) +
         "[[ $funcstack[1] == _selfcal ]] && "
         "_bash_complete -o default -F _selfcal\n";
}

std::string FishCompletion(const CLI::App& app) {
  std::string script;
  ForEachCommand(app, "", [&](const std::string& path, const CLI::App& at) {
    // The subcommands of a command are completed until one of them is given.
    std::string condition = "__fish_use_subcommand";
    if (!path.empty()) {
      condition.clear();
      for (std::size_t begin = 0; begin < path.size();) {
        const std::size_t end = std::min(path.find(' ', begin), path.size());
        condition += fmt::format("{}__fish_seen_subcommand_from {}",
                                 condition.empty() ? "" : "; and ",
                                 path.substr(begin, end - begin));
        begin = end + 1;
      }
    }
    for (const CLI::App* command : CommandsOf(at)) {
      script += fmt::format("complete -c selfcal -n {} -a {} -d {}\n",
                            Quoted(condition),
                            command->get_name(),
                            Quoted(command->get_description()));
    }
    for (const CLI::Option* option :
         at.get_options([](const CLI::Option*) { return true; })) {
      for (const std::string& name : option->get_lnames()) {
        script += fmt::format("complete -c selfcal{} -l {} -d {}\n",
                              path.empty() ? "" : " -n " + Quoted(condition),
                              name,
                              Quoted(option->get_description()));
      }
    }
  });
  return script;
}

void AddCompletionCommand(CLI::App* app, Context* context) {
  CLI::App* completion = app->add_subcommand(
      "completion",
      "Print a script that completes the command line in a shell: source "
      "<(selfcal completion bash)");
  const auto shell = std::make_shared<std::string>();
  completion->add_option("SHELL", *shell, "bash, zsh or fish")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh", "fish"}));
  completion->callback([app, context, shell] {
    context->command = [app, shell] {
      PrintText(*shell == "bash"  ? BashCompletion(*app)
                : *shell == "zsh" ? ZshCompletion(*app)
                                  : FishCompletion(*app));
      return kDone;
    };
  });
}

}  // namespace selfcal::client
