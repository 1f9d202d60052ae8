#include "server/grpc/caller.h"

#include <grpc/grpc_security_constants.h>
#include <grpcpp/security/auth_context.h>

#include <vector>

namespace selfcal::server {
namespace {

std::vector<std::string> Properties(const grpc::ServerContextBase& call,
                                    const char* name) {
  std::vector<std::string> values;
  const auto context = call.auth_context();
  if (context == nullptr) return values;
  for (const grpc::string_ref& value : context->FindPropertyValues(name)) {
    values.emplace_back(value.data(), value.size());
  }
  return values;
}

bool HasCertificate(const grpc::ServerContextBase& call) {
  return !Properties(call, GRPC_X509_PEM_CERT_PROPERTY_NAME).empty();
}

std::string CallerName(const grpc::ServerContextBase& call) {
  if (!HasCertificate(call)) {
    const bool local = call.peer().starts_with("unix");
    return local ? "local" : "insecure";
  }
  for (const char* property :
       {GRPC_X509_CN_PROPERTY_NAME, GRPC_X509_SAN_PROPERTY_NAME}) {
    for (const std::string& name : Properties(call, property)) {
      if (!name.empty()) return PrintableName(name);
    }
  }
  return "unnamed certificate";
}

}  // namespace

Caller CallerOf(const grpc::ServerContextBase& call, Role local) {
  Caller caller{CallerName(call), {}};
  if (!HasCertificate(call)) {
    caller.grants.push_back({local, ""});
    return caller;
  }
  for (const std::string& uri : Properties(call, GRPC_PEER_URI_PROPERTY_NAME)) {
    if (const auto grant = ParseGrant(uri)) caller.grants.push_back(*grant);
  }
  return caller;
}

}  // namespace selfcal::server
