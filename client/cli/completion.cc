#include "client/cli/completion.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <memory>
#include <set>
#include <vector>

#include "client/cli/choice.h"
#include "client/cli/commands.h"
#include "client/cli/context.h"
#include "client/cli/missing_rig.h"
#include "client/cli/usage_errors.h"

namespace selfcal::client {
namespace {

// A person waits for the names of the rigs.
constexpr std::chrono::milliseconds kRigTime{700};

// A flag, and whether a value follows it.
struct Flag {
  std::string name;  // "--target"
  bool takes_value = false;
};

// Returns the flags of a command, without those of the program.
std::vector<Flag> FlagsOf(const CLI::App& app) {
  std::vector<Flag> flags;
  for (const CLI::Option* option :
       app.get_options([](const CLI::Option*) { return true; })) {
    for (const std::string& name : option->get_lnames()) {
      flags.push_back({"--" + name, option->get_items_expected_max() > 0});
    }
  }
  return flags;
}

// True if the first argument of a command is a rig.
bool TakesRig(const CLI::App& command) {
  for (const CLI::Option* option :
       command.get_options([](const CLI::Option*) { return true; })) {
    if (option->get_positional()) return option->get_single_name() == "RIG";
  }
  return false;
}

// Callback for each command, with the words that lead to it.
using Visit =
    std::function<void(const std::string& path, const CLI::App& command)>;
void ForEachCommand(const CLI::App& app,
                    const std::string& path,
                    const Visit& visit) {
  visit(path, app);
  for (const CLI::App* command : ShownCommands(app)) {
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

// The names of rigs come from the daemon, with the connection that the line
// names.
std::string BashCompletion(const CLI::App& app) {
  std::string paths;
  std::string words;
  std::string rigs;
  std::set<std::string> with_value;
  ForEachCommand(app, "", [&](const std::string& path, const CLI::App& at) {
    std::string here;
    for (const CLI::App* command : ShownCommands(at)) {
      here += command->get_name() + " ";
      paths += fmt::format("      '{} {}') path=\"$path $word\" ;;\n",
                           path.empty() ? "" : " " + path,
                           command->get_name());
      for (const std::string& alias : command->get_aliases()) {
        paths += fmt::format("      '{} {}') path=\"$path {}\" ;;\n",
                             path.empty() ? "" : " " + path,
                             alias,
                             command->get_name());
      }
    }
    for (const Flag& flag : FlagsOf(at)) {
      here += flag.name + " ";
      if (flag.takes_value) with_value.insert(flag.name);
    }
    words += fmt::format("    '{}') words={} ;;\n",
                         path.empty() ? "" : " " + path,
                         Quoted(here));
    if (TakesRig(at)) rigs += (rigs.empty() ? "' " : "|' ") + path + "'";
  });
  std::string global;
  for (const Flag& flag : FlagsOf(app)) global += flag.name + " ";
  return fmt::format(
      R"sh(_selfcal() {{
  local path='' word words='' flag='' arguments=0
  local -a daemon=()
  for word in "${{COMP_WORDS[@]:1:COMP_CWORD-1}}"; do
    if [[ $word == = ]]; then continue; fi
    if [[ -n $flag ]]; then
      case "$flag" in
        --target|--ca|--cert|--key) daemon+=("$flag" "$word") ;;
      esac
      flag=''
      continue
    fi
    case "$word" in
      {}) flag=$word; continue ;;
      -*) continue ;;
    esac
    case "$path $word" in
{}      *) arguments=$((arguments + 1)) ;;
    esac
  done
  case "$path" in
{}  esac
  words="$words {}"
  if [[ $flag == --device ]]; then
    words=$(selfcal completion rigs "${{daemon[@]}}" 2>/dev/null)
  elif [[ $arguments == 0 && ${{COMP_WORDS[COMP_CWORD]}} != -* ]]; then
    case "$path" in
      {}) words="$words $(selfcal completion rigs "${{daemon[@]}}" 2>/dev/null)" ;;
    esac
  fi
  COMPREPLY=($(compgen -W "$words" -- "${{COMP_WORDS[COMP_CWORD]}}"))
}}
complete -o default -F _selfcal selfcal
)sh",
      fmt::join(with_value, "|"),
      paths,
      words,
      global,
      rigs);
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
    for (const CLI::App* command : ShownCommands(at)) {
      script += fmt::format("complete -c selfcal -n {} -a {} -d {}\n",
                            Quoted(condition),
                            command->get_name(),
                            Quoted(command->get_description()));
    }
    if (TakesRig(at)) {
      script += fmt::format(
          "complete -c selfcal -f -n {} -a '(selfcal completion rigs "
          "2>/dev/null)' -d rig\n",
          Quoted(condition));
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
  completion
      ->add_option("SHELL",
                   *shell,
                   "bash, zsh or fish; or rigs, for the names of the rigs, "
                   "which the scripts ask for")
      ->required()
      ->check(OneOf({"bash", "zsh", "fish", "rigs"}));
  completion->callback([app, context, shell] {
    context->command = [app, context, shell] {
      if (*shell == "rigs") {
        // The user is typing a command: prints no errors, and does not wait.
        for (const std::string& rig : ReadRigNames(*context, kRigTime)) {
          PrintText(rig + "\n");
        }
        return kDone;
      }
      PrintText(*shell == "bash"  ? BashCompletion(*app)
                : *shell == "zsh" ? ZshCompletion(*app)
                                  : FishCompletion(*app));
      return kDone;
    };
  });
}

}  // namespace selfcal::client
