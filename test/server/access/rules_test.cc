#include "server/access/rules.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/dynamic_message.h>
#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "selfcal/v1/calibration_service.pb.h"
#include "selfcal/v1/recalibration.pb.h"
#include "selfcal/v1/rig.pb.h"
#include "selfcal/v1/segment.pb.h"
#include "selfcal/v1/store_service.pb.h"

namespace selfcal::server {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::MethodDescriptor;

// Every method of every service of the contract. A service in a new file must
// be named here: server_test fails for one that is served and is not.
std::vector<const MethodDescriptor*> Methods() {
  std::vector<const MethodDescriptor*> methods;
  for (const auto* file : {v1::GetRigRequest::descriptor()->file(),
                           v1::GetSegmentRequest::descriptor()->file(),
                           v1::GetCalibrationRequest::descriptor()->file(),
                           v1::GetRecalibrationRequest::descriptor()->file(),
                           v1::ListEventsRequest::descriptor()->file()}) {
    for (int s = 0; s < file->service_count(); ++s) {
      for (int m = 0; m < file->service(s)->method_count(); ++m) {
        methods.push_back(file->service(s)->method(m));
      }
    }
  }
  return methods;
}

const AccessRule& RuleOf(const MethodDescriptor& method) {
  for (const AccessRule& rule : AccessRules()) {
    if (rule.method == method.full_name()) return rule;
  }
  static const AccessRule none;
  ADD_FAILURE() << method.full_name() << " has no rule of access";
  return none;
}

// Writes the name to the field at a path like "rig.name".
void SetAt(google::protobuf::Message* message,
           const std::string& path,
           const std::string& name) {
  const auto dot = path.find('.');
  const auto* field =
      message->GetDescriptor()->FindFieldByName(path.substr(0, dot));
  ASSERT_NE(field, nullptr) << message->GetTypeName() << " has no " << path;
  const auto& reflection = *message->GetReflection();
  if (dot == path.npos) {
    reflection.SetString(message, field, name);
  } else {
    SetAt(
        reflection.MutableMessage(message, field), path.substr(dot + 1), name);
  }
}

// A request of the method for `name`, put wherever the rule looks for it.
std::unique_ptr<google::protobuf::Message> Request(
    const MethodDescriptor& method, const std::string& name) {
  std::unique_ptr<google::protobuf::Message> request(
      google::protobuf::MessageFactory::generated_factory()
          ->GetPrototype(method.input_type())
          ->New());
  std::istringstream fields{std::string(RuleOf(method).rig_field)};
  for (std::string field; std::getline(fields, field, ',');) {
    SetAt(request.get(), field, name);
  }
  return request;
}

TEST(Rules, EveryMethodHasOneAndARequestTypeOfItsOwn) {
  std::set<const Descriptor*> requests;
  std::set<std::string> methods;
  for (const MethodDescriptor* method : Methods()) {
    methods.insert(method->full_name());
    RuleOf(*method);
    EXPECT_TRUE(requests.insert(method->input_type()).second)
        << method->full_name() << " shares its request type";
    EXPECT_EQ(method->input_type()->file(), method->service()->file());
  }
  EXPECT_GE(methods.size(), 16u);
  for (const AccessRule& rule : AccessRules()) {
    EXPECT_EQ(methods.count(std::string(rule.method)), 1u)
        << rule.method << " is no method of the contract";
  }
}

TEST(Rules, EveryMethodWithANameInItsRequestIsBoundToTheRig) {
  for (const MethodDescriptor* method : Methods()) {
    const Descriptor& request = *method->input_type();
    const bool names = request.FindFieldByName("name") != nullptr ||
                       request.FindFieldByName("parent") != nullptr;
    if (names) {
      EXPECT_FALSE(RuleOf(*method).rig_field.empty()) << method->full_name();
    }
  }
}

TEST(Rules, NobodyWithoutAGrantPasses) {
  for (const MethodDescriptor* method : Methods()) {
    for (const std::string name : {"", "rigs/a", "rigs/a/segments/s~1", "x"}) {
      const auto status = Authorise({"nobody", {}}, *Request(*method, name));
      EXPECT_TRUE(absl::IsPermissionDenied(status)) << method->full_name();
    }
  }
}

TEST(Rules, RoleOnAllRigsPassesWhereItSuffices) {
  for (const Role role : {Role::kRead, Role::kProduce, Role::kAdminister}) {
    const Caller caller{"someone", {{role, ""}}};
    for (const MethodDescriptor* method : Methods()) {
      EXPECT_EQ(Authorise(caller, *Request(*method, "rigs/a")).ok(),
                RuleOf(*method).role <= role)
          << method->full_name() << " for " << RoleName(role);
    }
  }
}

TEST(Rules, RightsOnOneRigEndThere) {
  const Caller caller{"device", {{Role::kAdminister, "a"}}};
  for (const MethodDescriptor* method : Methods()) {
    const bool bound = !RuleOf(*method).rig_field.empty();
    const std::map<std::string, bool> expected = {
        {"rigs/a", bound},
        {"rigs/a/segments/s~1", bound},
        {"rigs/b", false},
        {"rigs/ab", false},
        {"rigs/b/segments/a~1", false},
        {"rigs/", false},
        {"rigs//a", false},
        {"a", false},
        {"x/rigs/a", false},
    };
    for (const auto& [name, passes] : expected) {
      EXPECT_EQ(Authorise(caller, *Request(*method, name)).ok(), passes)
          << method->full_name() << " of " << name;
    }
  }
}

TEST(Rules, GrantsAddUp) {
  const Caller caller{"two", {{Role::kRead, "a"}, {Role::kProduce, "b"}}};
  v1::StreamSegmentsRequest request;
  request.set_parent("rigs/b");
  EXPECT_TRUE(Authorise(caller, request).ok());
  request.set_parent("rigs/a");
  EXPECT_TRUE(absl::IsPermissionDenied(Authorise(caller, request)));
  // A later message of a stream.
  EXPECT_TRUE(Authorise(caller, v1::StreamSegmentsRequest()).ok());
}

TEST(Rules, MessageThatIsNoRequestIsDenied) {
  EXPECT_TRUE(absl::IsPermissionDenied(
      Authorise({"root", {{Role::kAdminister, ""}}}, v1::Rig())));
}

TEST(Rules, DenialSaysWhatIsMissing) {
  v1::StreamSegmentsRequest request;
  request.set_parent("rigs/b");
  const auto status = Authorise({"device", {{Role::kProduce, "a"}}}, request);
  EXPECT_NE(status.message().find("'produce' on the rig"), std::string::npos)
      << status;
  EXPECT_NE(status.message().find("device"), std::string::npos) << status;
}

}  // namespace
}  // namespace selfcal::server
