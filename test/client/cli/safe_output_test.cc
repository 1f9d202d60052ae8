// Text from the daemon reaches a terminal as text: whatever stands in the
// strings of its answers.
#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <string>
#include <vector>

#include "client/cli/context.h"
#include "proto/safe_text.h"
#include "test/client/cli/canned_store.h"
#include "test/client/cli/commands_fixture.h"

namespace selfcal::client {
namespace {

using google::protobuf::FieldDescriptor;

// A forged line, an escape sequence, NUL, and an override of the direction.
const std::string kHostile("!\nforged\r\033[2J\0\xe2\x80\xae\xc2\x9b", 19);

// Appends it to each string of the message, and of those in it.
void Poison(google::protobuf::Message* message) {
  const auto* reflection = message->GetReflection();
  std::vector<const FieldDescriptor*> fields;
  reflection->ListFields(*message, &fields);
  for (const FieldDescriptor* field : fields) {
    const bool is_text = field->type() == FieldDescriptor::TYPE_STRING;
    const bool is_message =
        field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE;
    const int size =
        field->is_repeated() ? reflection->FieldSize(*message, field) : 1;
    for (int i = 0; i < size && is_text; ++i) {
      if (field->is_repeated()) {
        reflection->SetRepeatedString(
            message,
            field,
            i,
            reflection->GetRepeatedString(*message, field, i) + kHostile);
      } else {
        reflection->SetString(
            message, field, reflection->GetString(*message, field) + kHostile);
      }
    }
    for (int i = 0; i < size && is_message; ++i) {
      Poison(field->is_repeated()
                 ? reflection->MutableRepeatedMessage(message, field, i)
                 : reflection->MutableMessage(message, field));
    }
  }
}

// No line is forged, and nothing controls a terminal.
void ExpectSafe(const Outcome& outcome) {
  for (const std::string& text : {outcome.out, outcome.err}) {
    EXPECT_EQ(SafeLines(text), text);
    EXPECT_THAT(text, testing::Not(testing::HasSubstr("\nforged")));
  }
}

class SafeOutput : public Commands {
 protected:
  SafeOutput() {
    v1::Rig rig = ToProto(ARig("device"));
    (*rig.mutable_labels())["site"] = "north";
    Poison(&rig);
    daemon_.rigs.push_back(rig);
    v1::Segment segment;
    segment.set_name("rigs/device/segments/a~0");
    segment.set_state(v1::Segment::UNUSABLE);
    segment.set_problem("damaged");
    auto* score = segment.add_scores();
    score->set_group("imu");
    Poison(&segment);
    daemon_.segments.push_back(segment);
    v1::Table* table = daemon_.tables.add_tables();
    table->set_name("rigs/device/tables/imu");
    table->add_entries()->set_segment("rigs/device/segments/a~0");
    Poison(table);
    for (const int version : {1, 2}) {
      v1::Calibration calibration = Version(version);
      calibration.set_name("rigs/device/calibrations/" +
                           std::to_string(version));
      calibration.add_reasons("does not fit");
      calibration.mutable_verdict()->add_sentences("weak");
      Poison(&calibration);
      daemon_.calibrations.push_back(calibration);
    }
    v1::Recalibration run;
    run.set_name("rigs/device/recalibrations/1");
    run.set_state(v1::Recalibration::FAILED);
    run.set_message("out of luck");
    Poison(&run);
    daemon_.run.push_back(run);
    daemon_.refusal = BadField("rig.id" + kHostile, "is wrong" + kHostile);
  }
};

TEST_F(SafeOutput, TextOfTheDaemonControlsNoTerminal) {
  const std::vector<std::vector<std::string>> commands = {
      {"rig", "list"},
      {"rig", "show", "device"},
      {"rig", "create", WriteFile("{}")},
      {"segments", "list", "device"},
      {"segments", "show", "device", "a~0"},
      {"tables", "device"},
      {"calibrations", "list", "device"},
      {"calibrations", "show", "device", "active"},
      {"calibrations", "show", "device", "2"},
      {"calibrations", "watch", "device", "--once"},
      {"runs", "list", "device"},
      {"runs", "show", "device", "1"},
      {"calibrations", "activate", "device", "1", "--reason", kHostile},
      {"calibrations", "show", "device", "7" + kHostile},
  };
  for (const auto& command : commands) {
    SCOPED_TRACE(command[0] + " " + command[1]);
    const Outcome outcome = Selfcal(command);
    EXPECT_FALSE((outcome.out + outcome.err).empty());
    ExpectSafe(outcome);
  }
}

TEST_F(SafeOutput, EventsForgeNoLine) {
  CannedStore store;
  v1::Event event;
  event.set_number(1);
  event.set_detail("rolled back: too warm");
  Poison(&event);
  store.events.push_back(event);
  const Outcome outcome =
      client::Selfcal({"events", "device", "--target", store.target});
  EXPECT_THAT(outcome.out, testing::HasSubstr("too warm! forged"));
  ExpectSafe(outcome);
}

}  // namespace
}  // namespace selfcal::client
