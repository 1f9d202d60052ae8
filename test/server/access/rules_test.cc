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

// Labels of the rigs that there are.
absl::StatusOr<std::map<std::string, std::string>> LabelsOfRig(
    const std::string& rig) {
  if (rig == "a") return std::map<std::string, std::string>{{"site", "north"}};
  if (rig == "b") return std::map<std::string, std::string>{{"site", "south"}};
  return absl::NotFoundError("no such rig");
}

absl::Status Check(const Caller& caller,
                   const MethodDescriptor& method,
                   const google::protobuf::Message& request) {
  return Authorise(caller, method, request, LabelsOfRig);
}

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
  EXPECT_TRUE(Check({"nobody", {}}, *open[0], v1::GetCallerRequest()).ok());
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
          Check({"nobody", {}}, *method, *RequestFor(*method, name));
      EXPECT_TRUE(absl::IsPermissionDenied(status)) << method->full_name();
    }
  }
}

TEST(Rules, RoleOnAllRigsPassesWhereItSuffices) {
  for (const Role role : {Role::kRead, Role::kProduce, Role::kAdminister}) {
    const Caller caller{"someone", {{role, ""}}};
    for (const MethodDescriptor* method : Methods()) {
      EXPECT_EQ(Check(caller, *method, *RequestFor(*method, "rigs/a")).ok(),
                RuleOf(*method).role <= role)
          << method->full_name() << " for " << RoleName(role);
    }
  }
}

TEST(Rules, RightsOnOneRigEndThere) {
  const Caller caller{"device", {{Role::kAdminister, "a"}}};
  for (const MethodDescriptor* method : Methods()) {
    const bool bound = !RuleOf(*method).rig_field.empty();
    // A list that names no rig is of those of the caller.
    const bool other = !bound && IsLimitedToRights(*method);
    const std::map<std::string, bool> expected = {
        {"rigs/a", bound || other},
        {"rigs/a/segments/s~1", bound || other},
        {"rigs/b", other},
        {"rigs/ab", other},
        {"rigs/b/segments/a~1", other},
        {"rigs/", other},
        {"rigs//a", other},
        {"a", other},
        {"x/rigs/a", other},
    };
    for (const auto& [name, passes] : expected) {
      EXPECT_EQ(Check(caller, *method, *RequestFor(*method, name)).ok(), passes)
          << method->full_name() << " of " << name;
    }
  }
}

TEST(Rules, RightsOnALabelAreOnTheRigsThatHaveIt) {
  const Caller caller{"north",
                      {{Role::kAdminister, "", Label("site", "north")}}};
  for (const MethodDescriptor* method : Methods()) {
    const bool bound = !RuleOf(*method).rig_field.empty();
    const bool other = !bound && IsLimitedToRights(*method);
    const bool creates = method->name() == "CreateRig";  // without labels
    const std::map<std::string, bool> expected = {
        {"rigs/a", (bound && !creates) || other},
        {"rigs/a/segments/s~1", (bound && !creates) || other},
        {"rigs/b", other},
        {"rigs/c", other},
        {"rigs/", other},
        {"a", other},
    };
    for (const auto& [name, passes] : expected) {
      EXPECT_EQ(Check(caller, *method, *RequestFor(*method, name)).ok(), passes)
          << method->full_name() << " of " << name;
    }
  }
}

TEST(Rules, RigIsCreatedByWhoHasTheRoleOnItsLabels) {
  const MethodDescriptor& create =
      *v1::CreateRigRequest::descriptor()->file()->service(0)->FindMethodByName(
          "CreateRig");
  const Caller caller{"north",
                      {{Role::kAdminister, "", Label("site", "north")}}};
  v1::CreateRigRequest request;
  request.mutable_rig()->set_name("rigs/new");
  EXPECT_TRUE(absl::IsPermissionDenied(Check(caller, create, request)));
  const auto set = [&](const std::string& name, const std::string& value) {
    (*request.mutable_rig()->mutable_labels())[name] = value;
  };
  set("site", "south");
  set("model", "north");
  EXPECT_TRUE(absl::IsPermissionDenied(Check(caller, create, request)));
  set("site", "north");
  EXPECT_TRUE(Check(caller, create, request).ok());
}

TEST(Rules, LabelsThatCannotBeReadGrantNothing) {
  const MethodDescriptor& get =
      *v1::GetRigRequest::descriptor()->file()->service(0)->FindMethodByName(
          "GetRig");
  v1::GetRigRequest request;
  request.set_name("rigs/a");
  const absl::Status status = Authorise(
      {"north", {{Role::kRead, "", Label("site", "north")}}},
      get,
      request,
      [](const std::string&) { return absl::UnavailableError("away"); });
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
}

// Whoever has a role on some rigs gets lists, which are of these rigs alone
// (LimitedCallerTest), and nothing else that concerns all rigs.
TEST(Rules, OnlyListsAreOpenWithoutTheRoleOnEveryRig) {
  const Caller caller{"device", {{Role::kAdminister, "a"}}};
  for (const MethodDescriptor* method : Methods()) {
    if (!RuleOf(*method).rig_field.empty()) continue;
    EXPECT_EQ(Check(caller, *method, *RequestFor(*method, "")).ok(),
              IsLimitedToRights(*method))
        << method->full_name();
    EXPECT_TRUE(!IsLimitedToRights(*method) ||
                RuleOf(*method).role == Role::kRead)
        << method->full_name();
  }
}

TEST(Rules, GrantsAddUp) {
  const Caller caller{"two", {{Role::kRead, "a"}, {Role::kProduce, "b"}}};
  v1::StreamSegmentsRequest request;
  request.set_parent("rigs/b");
  EXPECT_TRUE(Check(caller, Streaming(), request).ok());
  request.set_parent("rigs/a");
  EXPECT_TRUE(absl::IsPermissionDenied(Check(caller, Streaming(), request)));
  // A later message of a stream.
  EXPECT_TRUE(Check(caller, Streaming(), v1::StreamSegmentsRequest()).ok());
}

TEST(Rules, DenialSaysWhatIsMissing) {
  v1::StreamSegmentsRequest request;
  request.set_parent("rigs/b");
  const auto status =
      Check({"device", {{Role::kProduce, "a"}}}, Streaming(), request);
  EXPECT_NE(status.message().find("'produce' on the rig"), std::string::npos)
      << status;
  EXPECT_NE(status.message().find("device"), std::string::npos) << status;
}

}  // namespace
}  // namespace selfcal::server
