// The contract against the one that was released: it may only be added to.
#include <gmock/gmock.h>
#include <google/protobuf/descriptor.pb.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <vector>

#include "test/promise.h"
#include "test/proto/contract_lines.h"

namespace selfcal {
namespace {

using contract::Lines;
using google::protobuf::DescriptorPool;
using google::protobuf::FieldDescriptorProto;
using google::protobuf::FileDescriptor;
using google::protobuf::FileDescriptorProto;
using ::testing::IsEmpty;
using ::testing::Not;

// Lines that are not there any more.
std::vector<std::string> Missing(const Lines& released, const Lines& present) {
  std::vector<std::string> missing;
  std::set_difference(released.begin(),
                      released.end(),
                      present.begin(),
                      present.end(),
                      std::back_inserter(missing));
  return missing;
}

Lines Released() {
  std::ifstream file(SELFCAL_RELEASED_CONTRACT);
  Lines lines;
  for (std::string line; std::getline(file, line);) lines.insert(line);
  return lines;
}

TEST(Contract, HasAllThatWasReleased) {
  const Lines released = Released();
  ASSERT_GT(released.size(), 300u) << SELFCAL_RELEASED_CONTRACT;
  const auto missing = Missing(released, ContractLines(CompiledContract()));
  EXPECT_THAT(missing, IsEmpty()) << "old clients rely on these";
  Promise promise("the contract is only added to");
  promise.trials = static_cast<int>(released.size());
  promise.lost = static_cast<int>(missing.size());
}

using Change = std::function<void(FileDescriptorProto*)>;

// The contract with a change to the file of the segments.
Lines Changed(const Change& change) {
  DescriptorPool pool;
  ContractFiles files;
  std::function<const FileDescriptor*(const FileDescriptor&)> build =
      [&](const FileDescriptor& file) {
        if (const auto* built = pool.FindFileByName(file.name())) return built;
        for (int d = 0; d < file.dependency_count(); ++d) {
          build(*file.dependency(d));
        }
        FileDescriptorProto proto;
        file.CopyTo(&proto);
        if (file.name() == "selfcal/v1/segment.proto") change(&proto);
        return pool.BuildFile(proto);
      };
  for (const auto* file : CompiledContract()) {
    const auto* built = build(*file);
    EXPECT_NE(built, nullptr) << file->name();
    if (built != nullptr) files.push_back(built);
  }
  return ContractLines(files);
}

// Observations.z_px.
FieldDescriptorProto* Pixels(FileDescriptorProto* file) {
  for (auto& message : *file->mutable_message_type()) {
    for (auto& nested : *message.mutable_nested_type()) {
      if (nested.name() == "Observations") return nested.mutable_field(3);
    }
  }
  return nullptr;
}

TEST(Contract, AdditionsBreakNothing) {
  const Lines before = Changed([](FileDescriptorProto*) {});
  ASSERT_EQ(before, ContractLines(CompiledContract()));
  const Lines after = Changed([](FileDescriptorProto* file) {
    auto* field = file->mutable_message_type(0)->add_field();
    field->set_name("added");
    field->set_number(1000);
    field->set_type(FieldDescriptorProto::TYPE_DOUBLE);
    field->set_label(FieldDescriptorProto::LABEL_OPTIONAL);
  });
  EXPECT_EQ(after.size(), before.size() + 1);
  EXPECT_THAT(Missing(before, after), IsEmpty());
}

TEST(Contract, EveryKindOfBreakIsNoticed) {
  const Lines before = ContractLines(CompiledContract());
  const std::vector<std::pair<std::string, Change>> breaks = {
      {"number", [](auto* file) { Pixels(file)->set_number(9); }},
      {"name", [](auto* file) { Pixels(file)->set_name("pixels"); }},
      {"type",
       [](auto* file) {
         Pixels(file)->set_type(FieldDescriptorProto::TYPE_FLOAT);
       }},
      {"label",
       [](auto* file) {
         Pixels(file)->set_label(FieldDescriptorProto::LABEL_OPTIONAL);
       }},
      {"packing",
       [](auto* file) { Pixels(file)->mutable_options()->set_packed(false); }},
      {"field",
       [](auto* file) {
         file->mutable_message_type(1)->mutable_field()->RemoveLast();
       }},
      {"enum value",
       [](auto* file) {
         for (auto& message : *file->mutable_message_type()) {
           if (message.enum_type_size() == 0) continue;
           message.mutable_enum_type(0)->mutable_value(1)->set_number(77);
         }
       }},
      {"streaming",
       [](auto* file) {
         auto* method = file->mutable_service(0)->mutable_method(0);
         method->set_client_streaming(!method->client_streaming());
       }},
      {"response",
       [](auto* file) {
         auto* method = file->mutable_service(0)->mutable_method(1);
         method->set_output_type(".selfcal.v1.Segment");
       }},
      {"method", [](auto* file) {
         file->mutable_service(0)->mutable_method()->RemoveLast();
       }}};
  for (const auto& [what, change] : breaks) {
    EXPECT_THAT(Missing(before, Changed(change)), Not(IsEmpty())) << what;
  }
}

}  // namespace
}  // namespace selfcal
