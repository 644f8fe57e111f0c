#!/usr/bin/env bash
# Entry point of the container: run a command with the workspace sourced.
set -e
source /opt/ros/jazzy/setup.bash
if [ -f /ws/install/setup.bash ]; then
    source /ws/install/setup.bash
fi
exec "$@"
