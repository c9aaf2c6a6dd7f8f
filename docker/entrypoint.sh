#!/usr/bin/env bash
# Runs PKG EXE [ARGS] as ./run does, where nothing can be written but /tmp.
set -eu
if [ -n "${ROS_DISTRO:-}" ]; then
  set +u
  . "/opt/ros/$ROS_DISTRO/setup.bash"
  set -u
fi
export HOME=/tmp/home ROS_LOG_DIR=/tmp/log LFD_CACHE=/tmp/compiled
mkdir -p "$HOME" "$ROS_LOG_DIR"
# What was compiled is used from where its index could be written, too.
[ -d "$LFD_CACHE" ] || cp -r /opt/lfd/compiled "$LFD_CACHE"
exec /opt/lfd/run "$@"
