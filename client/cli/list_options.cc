#include "client/cli/list_options.h"

#include "client/cli/positive_number.h"

namespace selfcal::client {

void AddListOptions(CLI::App* list,
                    const std::string& order,
                    const std::string& filter_help,
                    ListOptions* options) {
  list->add_option(
          "--limit", options->limit, "Only this many, " + order + " [all]")
      ->check(AtLeastOne());
  list->add_option("--filter", options->filter, filter_help);
}

}  // namespace selfcal::client
