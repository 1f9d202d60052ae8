// Basalt's optical flow and estimator with one calibration, which both copy
// when they are constructed.
//
// Threads: Basalt's own two threads work between the input and Take(). Readings
// and images may come from a thread each; the calls wait while Basalt's queues
// are full. An image is processed when a reading after it has come.
//
// Licence: Apache-2.0. The file includes headers of Basalt, which is under the
// 3-clause BSD licence.
#pragma once

#include <basalt/imu/imu_types.h>
#include <basalt/optical_flow/optical_flow.h>
#include <basalt/utils/vio_config.h>
#include <basalt/vi_estimator/vio_estimator.h>
#include <tbb/concurrent_queue.h>

#include <Eigen/Core>
#include <basalt/calibration/calibration.hpp>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

namespace selfcal {
namespace basalt {

using Reading = ::basalt::ImuData<double>;
using Images = ::basalt::OpticalFlowInput;

// Basalt's output for one set of images, on the clock of the IMU.
struct Output {
  ::basalt::PoseVelBiasState<double>::Ptr state;
  // Tracks (opt_flow_res) and landmarks, to be drawn.
  ::basalt::VioVisualizationData::Ptr view;
};

class Odometry {
 public:
  Odometry(const ::basalt::VioConfig& config,
           const ::basalt::Calibration<double>& calibration,
           const Eigen::Vector3d& gravity,
           bool use_double)
      : flow_(
            ::basalt::OpticalFlowFactory::getOpticalFlow(config, calibration)),
        estimator_(::basalt::VioEstimatorFactory::getVioEstimator(
            config, calibration, gravity, /*use_imu=*/true, use_double)) {
    flow_->output_queue = &estimator_->vision_data_queue;
    estimator_->out_state_queue = &states_;
    estimator_->out_vis_queue = &views_;
  }
  ~Odometry() { End(); }
  Odometry(const Odometry&) = delete;
  Odometry& operator=(const Odometry&) = delete;

  // Begins where it is, as Basalt does: upright as the first reading states,
  // and without velocity and biases.
  void Begin() {
    estimator_->initialize(Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
  }
  // Begins with a state; the first images must be those of its time.
  void Begin(const ::basalt::PoseVelBiasState<double>& state) {
    estimator_->initialize(state.t_ns,
                           state.T_w_i,
                           state.vel_w_i,
                           state.bias_gyro,
                           state.bias_accel);
  }

  // The reading is copied, as Basalt changes what it is given.
  void AddReading(const Reading& reading) {
    estimator_->addIMUToQueue(std::make_shared<Reading>(reading));
  }
  void AddImages(std::int64_t t_ns,
                 const std::vector<::basalt::ImageData>& images) {
    const auto input = std::make_shared<Images>();
    input->t_ns = t_ns;
    input->img_data = images;
    flow_->input_queue.push(input);
  }

  // Returns false if there is no output yet.
  bool Take(Output* output) {
    if (!states_.try_pop(output->state)) return false;
    views_.pop(output->view);  // follows its state at once
    return output->state != nullptr && output->view != nullptr;
  }

  // Discards what was not processed yet, and ends Basalt's threads. Later
  // readings are ignored; there must be no later images.
  void End() {
    if (!flow_) return;
    Discard(&flow_->input_queue);
    Discard(&estimator_->vision_data_queue);
    Discard(&estimator_->imu_data_queue);
    // The estimator may wait for a reading after its images. It does not expect
    // a null pointer everywhere: a reading from far ahead lets it go on.
    const auto last = std::make_shared<Reading>();
    last->t_ns = std::numeric_limits<std::int64_t>::max();
    last->accel = Eigen::Vector3d(0, 0, 9.81);
    estimator_->imu_data_queue.push(last);
    flow_->input_queue.push(nullptr);
    flow_.reset();  // waits for its thread, which ends the estimator's
    estimator_->maybe_join();
  }

 private:
  template <typename Queue>
  static void Discard(Queue* queue) {
    typename Queue::value_type value;
    while (queue->try_pop(value)) {
    }
  }

  ::basalt::OpticalFlowBase::Ptr flow_;
  tbb::concurrent_bounded_queue<::basalt::PoseVelBiasState<double>::Ptr>
      states_;
  tbb::concurrent_bounded_queue<::basalt::VioVisualizationData::Ptr> views_;
  // Its thread uses the queues above, until it is destroyed.
  ::basalt::VioEstimatorBase::Ptr estimator_;
};

}  // namespace basalt
}  // namespace selfcal
