// Losses that several formats have in common.
#pragma once

#include <string>
#include <vector>

#include "client/formats/format.h"

namespace selfcal::client {

// Of a tool that takes readings as they are: unless the IMU is nominal.
void AddImuLoss(const std::string& tool,
                const ImuCalibration& imu,
                std::vector<Loss>* losses);

// Of a tool without time offsets.
void AddTimeOffsetLosses(const std::string& tool,
                         const Calibration& theta,
                         std::vector<Loss>* losses);
// Of a tool with one for all cameras, that of the first.
void AddSharedOffsetLosses(const std::string& tool,
                           const Calibration& theta,
                           std::vector<Loss>* losses);

// Of a tool whose gravity is elsewhere, or fixed.
void AddGravityLoss(const std::string& tool,
                    const Rig& rig,
                    std::vector<Loss>* losses);

// Cameras of a tool that has at most `count`: those are left.
void KeepCameras(const std::string& tool,
                 std::size_t count,
                 Calibration* theta,
                 std::vector<Loss>* losses);

// The rate that was given, or a usual one with its name in the losses.
double ImuRate(const FormatOptions& options,
               const std::string& field,
               std::vector<Loss>* losses);

// FormatError: a distortion model that the tool does not have.
[[noreturn]] void NoSuchModel(const std::string& tool,
                              std::size_t camera,
                              DistortionModel model,
                              const std::string& models);

}  // namespace selfcal::client
