// Copyright 2026 The sat_collision Authors
//
// Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file
// except in compliance with the License. You may obtain a copy of the License at
// http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
// writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
// WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the
// specific language governing permissions and limitations under the License.

// Floor of ../peers.py as a plain rclcpp node: it only receives and publishes.

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "diagnostic_msgs/msg/diagnostic_array.hpp"
#include "geometry_msgs/msg/polygon_stamped.hpp"
#include "rclcpp/rclcpp.hpp"
#include "std_msgs/msg/bool.hpp"

using diagnostic_msgs::msg::DiagnosticArray;
using geometry_msgs::msg::PolygonStamped;
using std_msgs::msg::Bool;
using Message = std::shared_ptr<const rclcpp::SerializedMessage>;
using std::chrono_literals::operator""ms;

class Floor : public rclcpp::Node
{
public:
  Floor()
  : Node("footprint_monitor")
  {
    const auto qos = rclcpp::QoS(10).deadline(300ms)
      .liveliness(rclcpp::LivelinessPolicy::ManualByTopic).liveliness_lease_duration(500ms);
    for (const auto topic : {"~/collision", "~/footprint/collision"}) {
      flag_publishers_.push_back(create_publisher<Bool>(topic, qos));
    }
    diagnostics_ = create_publisher<DiagnosticArray>("/diagnostics", 10);
    footprint_ = create_subscription<PolygonStamped>(
      "footprint", 1, [this](Message message) {answer(*message);});
    obstacles_ = create_subscription<PolygonStamped>(
      "obstacles", 1000, [this](Message) {++received_;});
    timer_ = create_wall_timer(100ms, [this] {tick();});
  }

private:
  void answer(const rclcpp::SerializedMessage & message)
  {
    const auto sign_of_first_x = 27;
    flag_.data = message.get_rcl_serialized_message().buffer[sign_of_first_x] > 127;
    publish();
  }

  void tick()
  {
    publish();
    if (ticks_++ % 10 == 0) {
      DiagnosticArray report;
      report.status.resize(1);
      report.status[0].values.resize(1);
      report.status[0].values[0].key = "obstacle: received";
      report.status[0].values[0].value = std::to_string(received_);
      diagnostics_->publish(report);
    }
  }

  void publish()
  {
    for (const auto & publisher : flag_publishers_) {
      publisher->publish(flag_);
    }
  }

  Bool flag_;
  int received_ = 0;
  int ticks_ = 0;
  std::vector<rclcpp::Publisher<Bool>::SharedPtr> flag_publishers_;
  rclcpp::Publisher<DiagnosticArray>::SharedPtr diagnostics_;
  rclcpp::Subscription<PolygonStamped>::SharedPtr footprint_, obstacles_;
  rclcpp::TimerBase::SharedPtr timer_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<Floor>());
  rclcpp::shutdown();
}
