"""ROS 1 without a ROS installation: a small TCPROS client, and the paper's topics on it."""
