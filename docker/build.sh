#!/usr/bin/env bash
# What both images have in common: the project built in /opt/lfd, and a user to run it.
set -eu
cd /opt/lfd
if [ -n "${ROS_DISTRO:-}" ]; then
  set +u
  . "/opt/ros/$ROS_DISTRO/setup.bash"
  set -u
fi
export LFD_CACHE=/opt/lfd/compiled
make setup
rm -rf ~/.cache ros2_ws/log
useradd --uid 1000 --create-home lfd 2>/dev/null || true
chmod -R a+rX /opt/lfd
