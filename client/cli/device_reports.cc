#include "client/cli/device_reports.h"

#include <fmt/format.h>

#include "selfcal/v1/activity_service.grpc.pb.h"

namespace selfcal::client {

std::optional<v1::ReportState> ReadDeviceReports(const Context& context,
                                                 const std::string& rig) {
  using ActivityService = v1::ActivityService::StubInterface;
  const auto stub = v1::ActivityService::NewStub(context.Channel());
  v1::ListActivityRequest request;
  request.set_filter(fmt::format("name = \"{}\"", rig));
  v1::ListActivityResponse activity;
  const auto status = Call<ActivityService>(
      stub.get(), &ActivityService::ListActivity, request, &activity);
  if (!status.ok() || activity.rigs_size() != 1 ||
      !activity.rigs(0).has_device()) {
    return std::nullopt;
  }
  return activity.rigs(0).device();
}

}  // namespace selfcal::client
