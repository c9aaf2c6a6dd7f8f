"""An Imu of a bag as the numbers that it is made of: read so, it takes half the time.

Half of the messages of a drive are Imus, and of no other message is so much never looked at.
"""

IMU, PLAIN_IMU = "sensor_msgs/msg/Imu", "lfd_replay/msg/PlainImu"

DEFINITION = "std_msgs/Header header\nfloat64[37] numbers"
"""As it lies in a bag: after the header nothing but numbers."""

LAYOUT = "RIHS01_7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b"
"""Hash of the definition whose numbers lie so; a bag may bring one of its own."""

ANGULAR_VELOCITY, ITS_COVARIANCE, LINEAR_ACCELERATION = slice(13, 16), 16, slice(25, 28)
"""Where those numbers are, of the covariance the first one."""
