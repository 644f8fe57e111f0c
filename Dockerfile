# The stack on ROS 2 Jazzy from apt, as docs/use.md describes it for a workspace.
#   docker build -t fluidic_hand . && docker run --rm -it fluidic_hand
FROM ros:jazzy
SHELL ["/bin/bash", "-o", "pipefail", "-c"]
WORKDIR /ws
# Three libraries are not in Ubuntu and come from pip: cobs, mcap, rosbags.
ENV PIP_BREAK_SYSTEM_PACKAGES=1

# Dependencies first: this layer is built again only when a package.xml changes.
COPY package.xml src/fluidic_hand/package.xml
COPY hand_msgs/package.xml src/fluidic_hand/hand_msgs/package.xml
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install -y --no-install-recommends python3-pip \
    && rosdep update --rosdistro jazzy \
    && rosdep install --from-paths src src/fluidic_hand/hand_msgs --ignore-src -y \
    && rm -rf /var/lib/apt/lists/*

COPY . src/fluidic_hand
RUN . /opt/ros/jazzy/setup.bash \
    && colcon build --base-paths src src/fluidic_hand/hand_msgs

ENTRYPOINT ["/ws/src/fluidic_hand/tools/container_entry.sh"]
CMD ["ros2", "launch", "fluidic_hand", "simulated_hand.launch.py"]
