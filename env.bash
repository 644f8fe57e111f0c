# Source this in every shell that uses the stack:  source env.bash
# It activates the virtual environment that `make` created, or Jazzy from apt if there is none, and then the built
# packages. ROS messages stay on this machine unless ROS_AUTOMATIC_DISCOVERY_RANGE is already set.
_hand_root="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"
if [ -f "$_hand_root/.venv/bin/activate" ]; then
    source "$_hand_root/.venv/bin/activate"
    export AMENT_PREFIX_PATH="$_hand_root/.venv" CMAKE_PREFIX_PATH="$_hand_root/.venv"
    export ROS_VERSION=2 ROS_DISTRO=jazzy
elif [ -f /opt/ros/jazzy/setup.bash ]; then
    source /opt/ros/jazzy/setup.bash
fi
if [ -f "$_hand_root/install/setup.bash" ]; then
    source "$_hand_root/install/setup.bash"
fi
export ROS_AUTOMATIC_DISCOVERY_RANGE="${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}"
# BLAS threads do not speed up small arrays, and they would occupy the core that the control loop needs.
export OPENBLAS_NUM_THREADS="${OPENBLAS_NUM_THREADS:-1}" OMP_NUM_THREADS="${OMP_NUM_THREADS:-1}"
unset _hand_root
