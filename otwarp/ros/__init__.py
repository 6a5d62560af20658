"""Borders to ROS 1 and ROS 2, without an installation of either."""
