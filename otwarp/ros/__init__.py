"""Borders to ROS 1 and ROS 2; neither needs a ROS installation."""
