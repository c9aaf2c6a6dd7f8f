#!/usr/bin/env bash
# Health check of a container: health.sh NODE
set -eu
export HOME=/tmp/home ROS_LOG_DIR=/tmp/log
if [ -n "${ROS_DISTRO:-}" ]; then
  set +u
  . "/opt/ros/$ROS_DISTRO/setup.bash"
  set -u
fi
exec /opt/lfd/tools/in_workspace python /opt/lfd/docker/health.py "$1"
