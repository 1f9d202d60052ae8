// Every method that has an address asks for its role, over HTTP as over gRPC.
#include "google/api/annotations.pb.h"
#include "server/console/transcoding.h"
#include "test/server/access/contract.h"
#include "test/server/console/console_test.h"

namespace selfcal::server {
namespace {

using google::api::HttpRule;

// The address of a rule, with `rig` in place of every rig and "x" in place of
// what else a pattern leaves open.
HttpRequest RequestAt(const HttpRule& rule, const std::string& rig) {
  HttpRequest request;
  std::string path;
  switch (rule.pattern_case()) {
    case HttpRule::kGet:
      request.method = "GET", path = rule.get();
      break;
    case HttpRule::kPost:
      request.method = "POST", path = rule.post();
      break;
    case HttpRule::kPatch:
      request.method = "PATCH", path = rule.patch();
      break;
    case HttpRule::kDelete:
      request.method = "DELETE", path = rule.delete_();
      break;
    default:
      ADD_FAILURE() << rule.ShortDebugString();
  }
  const auto open = path.find('{');
  if (open != path.npos) {
    const auto equals = path.find('=', open);
    const auto close = path.find('}', open);
    std::string pattern = path.substr(equals + 1, close - equals - 1);
    pattern.replace(pattern.find('*'), 1, rig);
    if (const auto star = pattern.find('*'); star != pattern.npos) {
      pattern.replace(star, 1, "x");
    }
    path.replace(open, close + 1 - open, pattern);
  }
  request.path = "/api" + path;
  if (!rule.body().empty()) request.body = "{}";
  return request;
}

struct Address {
  const MethodDescriptor* method;
  HttpRule rule;
};

std::vector<Address> Addresses() {
  std::vector<Address> addresses;
  for (const MethodDescriptor* method : Methods()) {
    if (!method->options().HasExtension(google::api::http)) continue;
    const HttpRule& rule = method->options().GetExtension(google::api::http);
    addresses.push_back({method, rule});
    for (const HttpRule& more : rule.additional_bindings()) {
      addresses.push_back({method, more});
    }
  }
  return addresses;
}

class RolesTest : public ConsoleTest {
 protected:
  RolesTest() : transcoding_(&*api_) {}

  bool Denied(const Address& address,
              const std::vector<Grant>& grants,
              const std::string& rig) {
    HttpRequest request = RequestAt(address.rule, rig);
    if (request.method == "POST" && request.path == "/api/v1/rigs") {
      request.body = R"({"name": "rigs/)" + rig + R"("})";
    }
    if (request.path.find(":compare") != std::string::npos) {
      request.query["b"] = "rigs/" + rig + "/calibrations/x";
    }
    request.caller = {"somebody", grants};
    const HttpResponse response = transcoding_.Answer(request);
    EXPECT_NE(response.status, 405) << request.path;
    return response.status == 403;
  }

  Transcoding transcoding_;
};

TEST_F(RolesTest, EveryMethodAsksForItsRole) {
  AddRig("r");
  ASSERT_GE(Addresses().size(), 20u);
  for (const Address& address : Addresses()) {
    const AccessRule rule = RuleOf(*address.method);
    for (const Role role : {Role::kRead, Role::kProduce, Role::kAdminister}) {
      EXPECT_EQ(Denied(address, {{role, ""}}, "r"), role < rule.role)
          << address.method->full_name() << " for " << RoleName(role);
    }
    EXPECT_TRUE(Denied(address, {}, "r")) << address.method->full_name();
    // A list that names no rig is of those of the caller.
    const bool names_rig = address.rule.get().find('{') != std::string::npos;
    EXPECT_EQ(Denied(address, {{Role::kAdminister, "other"}}, "r"),
              names_rig || !IsLimitedToRights(*address.method))
        << address.method->full_name();
  }
}

TEST_F(RolesTest, MethodsWithoutAnAddressAreThoseOfStreamsOfBytes) {
  std::vector<std::string> without;
  for (const MethodDescriptor* method : Methods()) {
    if (!method->options().HasExtension(google::api::http)) {
      without.push_back(method->name());
    }
  }
  EXPECT_THAT(without,
              ::testing::UnorderedElementsAre(
                  "StreamSegments", "BackupStore", "RestoreStore"));
}

}  // namespace
}  // namespace selfcal::server
