"""Health check of a container: its node says on /diagnostics that it lives.

`health.py NODE`: exit status 0 where the node has said anything within three seconds, else 1. A
node that waits for its sensors is healthy; one that is stuck or gone says nothing.
"""

import sys
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray

SECONDS = 3.0


def main() -> int:
    """Listen for a while."""
    wanted = f"{sys.argv[1]}: "
    heard: list[str] = []
    rclpy.init()
    node = rclpy.create_node("health_check")
    node.create_subscription(
        DiagnosticArray,
        "/diagnostics",
        lambda array: heard.extend(s.message for s in array.status if wanted in s.name),
        10,
    )
    deadline = time.monotonic() + SECONDS
    while not heard and time.monotonic() < deadline:
        rclpy.spin_once(node, timeout_sec=0.1)
    rclpy.try_shutdown()
    print(heard[0] if heard else f"{sys.argv[1]} said nothing for {SECONDS:g} s")
    return 0 if heard else 1


if __name__ == "__main__":
    sys.exit(main())
