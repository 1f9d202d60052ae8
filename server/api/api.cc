#include "server/api/api.h"

#include <utility>

#include "server/api/methods.h"

namespace selfcal::server {

Api::Api(Domain* domain,
         Pipeline* pipeline,
         EventFeed* feed,
         ApiOptions options)
    : watches_(domain->store()), versions_(domain->store()) {
  pipeline->ListenForDeletions(watches_.DeletionHandler());
  Methods methods({domain,
                   domain->store(),
                   pipeline,
                   feed,
                   &watches_,
                   &versions_,
                   &traffic_,
                   &stopping_,
                   std::move(options.restored),
                   std::move(options.program_version)});
  AddRigMethods(&methods);
  AddSegmentMethods(&methods);
  AddSessionMethods(&methods);
  AddCalibrationMethods(&methods);
  AddRecalibrationMethods(&methods);
  AddStoreMethods(&methods);
  AddActivityMethods(&methods);
  AddFleetMethods(&methods);
  AddUplinkMethods(&methods);
  methods_ = methods.Take();
}

}  // namespace selfcal::server
