#include "server/console/routes.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "google/api/annotations.pb.h"
#include "proto/safe_text.h"
#include "server/api/errors.h"

namespace selfcal::server {
namespace {

using google::api::HttpRule;
using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using nlohmann::json;

constexpr std::size_t kMaxEcho = 100;

// The HTTP method of a rule and its path.
std::pair<std::string, std::string> AddressOf(const HttpRule& rule) {
  switch (rule.pattern_case()) {
    case HttpRule::kGet:
      return {"GET", rule.get()};
    case HttpRule::kPost:
      return {"POST", rule.post()};
    case HttpRule::kPatch:
      return {"PATCH", rule.patch()};
    case HttpRule::kDelete:
      return {"DELETE", rule.delete_()};
    default:
      return {};
  }
}

std::vector<std::string_view> Split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (;;) {
    const std::size_t end = text.find(separator);
    parts.push_back(text.substr(0, end));
    if (end == text.npos) return parts;
    text.remove_prefix(end + 1);
  }
}

// The field of that name in the contract or in JSON.
const FieldDescriptor* FindField(const Descriptor& message,
                                 const std::string& name) {
  const FieldDescriptor* field = message.FindFieldByName(name);
  return field != nullptr ? field : message.FindFieldByCamelcaseName(name);
}

// Sets the field at a path such as "rig.name"; false if there is none. Texts
// stand for numbers and names of enumerators, as in the JSON of protobuf.
bool SetText(const Descriptor& message,
             const std::string& path,
             const std::string& text,
             json* to) {
  const std::size_t dot = path.find('.');
  const FieldDescriptor* field = FindField(message, path.substr(0, dot));
  if (field == nullptr) return false;
  json& value = (*to)[field->json_name()];
  if (dot != path.npos) {
    const Descriptor* inner = field->message_type();
    return inner != nullptr && !field->is_repeated() &&
           SetText(*inner, path.substr(dot + 1), text, &value);
  }
  const json scalar =
      field->cpp_type() == FieldDescriptor::CPPTYPE_BOOL && text == "true"
          ? json(true)
      : field->cpp_type() == FieldDescriptor::CPPTYPE_BOOL && text == "false"
          ? json(false)
          : json(text);
  value = field->is_repeated() ? json::array({scalar}) : scalar;
  return true;
}

absl::StatusOr<json> BodyOf(const HttpRequest& request,
                            const std::string& field) {
  json parsed = json::object();
  if (!request.body.empty()) {
    parsed = json::parse(request.body, nullptr, false);
  }
  if (!parsed.is_object()) {
    return absl::InvalidArgumentError(
        "the body must be a JSON object, such as {\"reason\": \"...\"}");
  }
  return field == "*" ? parsed : json{{field, std::move(parsed)}};
}

}  // namespace

Routes::Route Routes::ParseTemplate(std::string_view path) {
  Route route;
  const std::size_t colon = path.rfind(':');
  if (colon != path.npos && path.find('}', colon) == path.npos) {
    route.verb = path.substr(colon + 1);
    path = path.substr(0, colon);
  }
  // {field=pattern} may span several parts.
  std::string field;
  for (std::string_view part : Split(path.substr(1), '/')) {
    if (part.starts_with('{')) {
      const std::size_t equals = part.find('=');
      field = part.substr(1, equals - 1);
      part.remove_prefix(equals + 1);
    }
    const bool last = part.ends_with('}');
    if (last) part.remove_suffix(1);
    route.parts.push_back({part == "*" ? "" : std::string(part), field});
    if (last) field.clear();
  }
  return route;
}

Routes::Routes(const Api& api) {
  for (const Method& method : api.methods()) {
    const auto& options = method.descriptor->options();
    if (!options.HasExtension(google::api::http)) continue;
    const HttpRule& rule = options.GetExtension(google::api::http);
    std::vector<const HttpRule*> rules = {&rule};
    for (const HttpRule& more : rule.additional_bindings()) {
      rules.push_back(&more);
    }
    for (const HttpRule* each : rules) {
      const auto [http_method, path] = AddressOf(*each);
      Route route = ParseTemplate(path);
      route.http_method = http_method;
      route.body = each->body();
      route.method = &method;
      routes_.push_back(std::move(route));
    }
  }
  std::stable_partition(routes_.begin(), routes_.end(), [](const Route& route) {
    return !route.verb.empty();
  });
}

// The texts of the fields; nullopt if the path is another.
std::optional<std::map<std::string, std::string>> Routes::Match(
    const Route& route, std::string_view path) {
  if (!route.verb.empty()) {
    if (!path.ends_with(":" + route.verb)) return std::nullopt;
    path.remove_suffix(route.verb.size() + 1);
  }
  const auto parts = Split(path, '/');
  if (parts.size() != route.parts.size()) return std::nullopt;
  std::map<std::string, std::string> fields;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const Part& wanted = route.parts[i];
    const bool any = wanted.literal.empty();
    if (any ? parts[i].empty() : parts[i] != wanted.literal) {
      return std::nullopt;
    }
    if (wanted.field.empty()) continue;
    std::string& text = fields[wanted.field];
    if (!text.empty()) text += '/';
    text += parts[i];
  }
  return fields;
}

absl::StatusOr<Routes::Request> Routes::Find(const HttpRequest& request) const {
  constexpr std::string_view kPrefix = "/api/";
  std::string_view path = request.path;
  path.remove_prefix(path.starts_with(kPrefix) ? kPrefix.size() : path.size());
  const std::string_view http_method =
      request.method == "HEAD" ? "GET" : std::string_view(request.method);
  bool known = false;
  for (const Route& route : routes_) {
    const auto fields = Match(route, path);
    if (!fields) continue;
    known = true;
    if (route.http_method != http_method) continue;
    const Descriptor& type = *route.method->request->GetDescriptor();
    json values = json::object();
    if (!route.body.empty()) {
      auto body = BodyOf(request, route.body);
      if (!body.ok()) return body.status();
      values = *std::move(body);
    }
    for (const auto& [name, text] : request.query) {
      if (SetText(type, name, text, &values)) continue;
      return InvalidFields(
          {{SafeLine(name, kMaxEcho),
            "is not a parameter of this address; docs/api.md lists them"}});
    }
    for (const auto& [name, text] : *fields) {
      SetText(type, name, text, &values);
    }
    std::unique_ptr<Message> message(route.method->request->New());
    // Bytes that are no UTF-8 are refused by the parser.
    const auto parsed = google::protobuf::util::JsonStringToMessage(
        values.dump(-1, ' ', false, json::error_handler_t::replace),
        message.get());
    if (!parsed.ok()) {
      return absl::InvalidArgumentError(
          "the request is no " + type.full_name() + ": " +
          SafeLine(std::string(parsed.message()), kMaxEcho));
    }
    return Request{route.method, std::move(message)};
  }
  if (known) {
    return absl::UnimplementedError("this address cannot be called with " +
                                    request.method);
  }
  return absl::NotFoundError(
      "there is nothing under this address; docs/api.md lists what is");
}

}  // namespace selfcal::server
