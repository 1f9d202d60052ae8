#include "server/access/rules.h"

#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include <map>
#include <set>
#include <string>
#include <vector>

#include "selfcal/v1/segment.pb.h"
#include "test/server/access/contract.h"

namespace selfcal::server {
namespace {

using google::protobuf::Descriptor;

const MethodDescriptor& Streaming() {
  return *v1::StreamSegmentsRequest::descriptor()
              ->file()
              ->service(0)
              ->FindMethodByName("StreamSegments");
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
}

TEST(Rules, OnlyWhoACallerIsIsOpenToAnybody) {
  const auto open = MethodsThat(IsOpenToAnybody);
  ASSERT_EQ(open.size(), 1u);
  EXPECT_EQ(open[0]->full_name(), "selfcal.v1.ActivityService.GetCaller");
  EXPECT_TRUE(Authorise({"nobody", {}}, *open[0], v1::GetCallerRequest()).ok());
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
      const auto status =
          Authorise({"nobody", {}}, *method, *RequestFor(*method, name));
      EXPECT_TRUE(absl::IsPermissionDenied(status)) << method->full_name();
    }
  }
}

TEST(Rules, RoleOnAllRigsPassesWhereItSuffices) {
  for (const Role role : {Role::kRead, Role::kProduce, Role::kAdminister}) {
    const Caller caller{"someone", {{role, ""}}};
    for (const MethodDescriptor* method : Methods()) {
      EXPECT_EQ(Authorise(caller, *method, *RequestFor(*method, "rigs/a")).ok(),
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
      EXPECT_EQ(Authorise(caller, *method, *RequestFor(*method, name)).ok(),
                passes)
          << method->full_name() << " of " << name;
    }
  }
}

TEST(Rules, GrantsAddUp) {
  const Caller caller{"two", {{Role::kRead, "a"}, {Role::kProduce, "b"}}};
  v1::StreamSegmentsRequest request;
  request.set_parent("rigs/b");
  EXPECT_TRUE(Authorise(caller, Streaming(), request).ok());
  request.set_parent("rigs/a");
  EXPECT_TRUE(
      absl::IsPermissionDenied(Authorise(caller, Streaming(), request)));
  // A later message of a stream.
  EXPECT_TRUE(Authorise(caller, Streaming(), v1::StreamSegmentsRequest()).ok());
}

TEST(Rules, DenialSaysWhatIsMissing) {
  v1::StreamSegmentsRequest request;
  request.set_parent("rigs/b");
  const auto status =
      Authorise({"device", {{Role::kProduce, "a"}}}, Streaming(), request);
  EXPECT_NE(status.message().find("'produce' on the rig"), std::string::npos)
      << status;
  EXPECT_NE(status.message().find("device"), std::string::npos) << status;
}

}  // namespace
}  // namespace selfcal::server
