#include "client/cli/list_options.h"

#include "client/cli/positive_number.h"

namespace selfcal::client {

void AddCsv(CLI::App* list, Context* context) {
  list->add_flag(
      "--csv", context->csv, "Print CSV, with all fields and exact values");
}

void AddListOptions(CLI::App* list,
                    Context* context,
                    const std::string& order,
                    const std::string& filter_help,
                    ListOptions* options) {
  list->add_option(
          "--limit", options->limit, "Only this many, " + order + " [all]")
      ->check(AtLeastOne());
  list->add_option("--filter", options->filter, filter_help);
  AddCsv(list, context);
}

void AddOrderBy(CLI::App* list, const std::string& help, ListOptions* options) {
  list->add_option(
      "--order-by", options->order_by, "A field, then asc or desc" + help);
}

void AddRigFilter(CLI::App* list, CLI::Option* rig, ListOptions* options) {
  list->add_option("--rigs",
                   options->rigs,
                   "Without RIG: only of these rigs, e.g. 'labels.model = "
                   "\"t4\"'")
      ->excludes(rig);
}

}  // namespace selfcal::client
