// Conversion of parts that several records share.
#pragma once

#include <absl/status/status.h>
#include <google/protobuf/message.h>
#include <google/protobuf/repeated_ptr_field.h>

#include <Eigen/Core>
#include <string>
#include <string_view>

#include "core/calibration/calibrate.h"
#include "core/model/calibration.h"
#include "selfcal/store/records.pb.h"

namespace selfcal::server {

// Parses a message that was stored. False for bytes that are none, or that
// would take far more memory than any record does (ParsedSize).
bool ParseStored(std::string_view bytes, google::protobuf::Message* message);

void PutMatrix(const Eigen::MatrixXd& matrix, store::MatrixRecord* record);
// False if the number of values does not match the dimensions.
bool GetMatrix(const store::MatrixRecord& record, Eigen::MatrixXd* matrix);

// Names of the components of what a record has over the tangent space of theta.
using ComponentNames = google::protobuf::RepeatedPtrField<std::string>;

// Names the components of `size` entries over the tangent space of theta; none
// if theta has another number of them.
void PutComponents(const Calibration& theta,
                   Eigen::Index size,
                   ComponentNames* names);

// Brings a matrix or vector of a record with these names to the tangent space
// of theta: inserts zeros for the components that the record does not have,
// which had no information and were known then. Without names, for those that
// the blocks of theta lacked when the record was stored. `more` entries follow
// those of theta. Leaves an empty one unchanged, and one without names of any
// other size. False if theta does not have a named component, or if the numbers
// of names and of entries differ.
bool ToTangent(const Calibration& theta,
               const ComponentNames& names,
               Eigen::MatrixXd* matrix,
               int more = 0);
bool ToTangent(const Calibration& theta,
               const ComponentNames& names,
               Eigen::VectorXd* vector,
               int more = 0);

// `moved` and `sigmas` may be empty. False if they have not the size of theta,
// or of its components with the names.
void PutStep(const CalibrateProgress& step, store::StepRecord* record);
bool GetStep(const store::StepRecord& record,
             const ComponentNames& names,
             CalibrateProgress* step);

absl::Status DamagedRecord(const std::string& what);

}  // namespace selfcal::server
