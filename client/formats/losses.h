// Losses that several formats have in common. Each function appends to the
// losses what a tool of the stated kind cannot express.
#pragma once

#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include "client/formats/format.h"

namespace selfcal::client {

// Whether readings need no correction.
bool IsNominal(const ImuCalibration& imu);

// For tools that use readings as they are: a loss unless the IMU is nominal.
void AddImuLoss(const std::string& tool,
                const ImuCalibration& imu,
                std::vector<Loss>* losses);

// For tools that correct readings by scales, misalignments, q_AI and the blocks
// in `has`, named as in parameter_blocks.h ("gyro.g_sensitivity"): a loss for
// each other block that corrects readings. `name` is "imu" or "imu1".
void AddImuBlockLosses(const std::string& tool,
                       std::initializer_list<std::string_view> has,
                       const std::string& name,
                       const ImuCalibration& imu,
                       std::vector<Loss>* losses);

// For tools without time offsets.
void AddTimeOffsetLosses(const std::string& tool,
                         const Calibration& theta,
                         std::vector<Loss>* losses);
// For tools with one time offset for all cameras, that of the first.
void AddSharedOffsetLosses(const std::string& tool,
                           const Calibration& theta,
                           std::vector<Loss>* losses);

// A tool that exposes an image at one time.
void AddLineDelayLosses(const std::string& tool,
                        const Calibration& theta,
                        std::vector<Loss>* losses);

// A tool whose cameras have a constant time offset.
void AddTimeDriftLosses(const std::string& tool,
                        const Calibration& theta,
                        std::vector<Loss>* losses);

// For tools whose gravity is set elsewhere, or fixed.
void AddGravityLoss(const std::string& tool,
                    const Rig& rig,
                    std::vector<Loss>* losses);

// For tools with at most `count` cameras: removes the others.
void KeepCameras(const std::string& tool,
                 std::size_t count,
                 Calibration* theta,
                 std::vector<Loss>* losses);

// For tools that use some models without the pixels of rays at 90 degrees from
// the axis or beyond, as a pinhole has none: cameras whose image shows such
// rays. `pinholes` are the tool's names of these models. Cameras are of models
// that the tool has.
void AddPinholeLosses(const std::string& tool,
                      const std::vector<CameraCalibration>& cameras,
                      std::vector<Loss>* losses,
                      std::initializer_list<std::string_view> pinholes = {
                          "pinhole"});

// Returns the given rate, or a usual one, which is then stated in the losses.
double ImuRate(const FormatOptions& options,
               const std::string& field,
               std::vector<Loss>* losses);

}  // namespace selfcal::client
