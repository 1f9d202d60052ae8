#include "server/store/postgres/store_uri.h"

#include <libpq-fe.h>

#include <map>
#include <memory>
#include <sstream>
#include <utility>

namespace selfcal::server {
namespace {

struct FreeOptions {
  void operator()(PQconninfoOption* options) const { PQconninfoFree(options); }
};

// "a:1,b:2" of the lists "a,b" and "1,2"; one port is that of all hosts.
std::string HostsWithPorts(const std::string& hosts, const std::string& ports) {
  std::istringstream host_list(hosts);
  std::istringstream port_list(ports);
  std::string shown;
  std::string host;
  std::string port;
  while (std::getline(host_list, host, ',')) {
    std::string next;
    if (std::getline(port_list, next, ',')) port = next;
    if (!shown.empty()) shown += ',';
    shown += host;
    if (!port.empty()) shown += ':' + port;
  }
  return shown;
}

}  // namespace

bool IsPostgresUri(std::string_view uri) {
  return uri.starts_with("postgresql://") || uri.starts_with("postgres://");
}

absl::StatusOr<std::string> ShownUri(const std::string& uri) {
  const auto invalid = absl::InvalidArgumentError(
      "the address of the store is not valid: it is written as "
      "postgresql://user@host:5432/database, with characters that a URI "
      "reserves in percent-encoding");
  if (!IsPostgresUri(uri)) return invalid;
  char* message = nullptr;  // it may quote the address, with its password
  const std::unique_ptr<PQconninfoOption, FreeOptions> options(
      PQconninfoParse(uri.c_str(), &message));
  PQfreemem(message);
  if (options == nullptr) return invalid;
  std::map<std::string, std::string> values;
  for (const PQconninfoOption* option = options.get();
       option->keyword != nullptr;
       ++option) {
    if (option->val != nullptr) values[option->keyword] = option->val;
  }
  std::string shown = "postgresql://";
  if (!values["user"].empty()) shown += values["user"] + '@';
  shown += HostsWithPorts(values["host"], values["port"]);
  return shown + '/' + values["dbname"];
}

}  // namespace selfcal::server
