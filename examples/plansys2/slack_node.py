"""A ROS 2 node: hears what PlanSys2's executor says of its actions, and publishes how much longer each may take."""

import rclpy
from feed import Feed, of_ros, slack
from plansys2_msgs.msg import ActionExecutionInfo
from rclpy.node import Node
from std_msgs.msg import String


class SlackNode(Node):
    """Publishes a line of JSON on ~/slack for each message that says something new."""

    def __init__(self) -> None:
        super().__init__("slack")
        for name in ("domain", "problem", "plan", "deadline"):
            self.declare_parameter(name, "")
        domain, problem, plan, deadline = (
            self.get_parameter(name).value for name in ("domain", "problem", "plan", "deadline")
        )
        self._feed = Feed(domain, problem, plan, deadline=deadline or None)
        self._publisher = self.create_publisher(String, "~/slack", 10)
        self.create_subscription(ActionExecutionInfo, "/action_execution_info", self._hear, 100)

    def _hear(self, message: ActionExecutionInfo) -> None:
        for outlook in self._feed.tell(of_ros(message)):
            self._publisher.publish(String(data=slack(outlook)))
            if outlook.prospect.value == "broken":
                self.get_logger().warn("; ".join(outlook.reasons))


def main() -> None:
    rclpy.init()
    rclpy.spin(SlackNode())


if __name__ == "__main__":
    main()
