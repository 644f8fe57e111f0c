"""How Fast DDS carries the messages of a node: by profiles in config/, where the user has none.

The usual transport between programs of one machine is shared memory. Fast DDS then waits in the publisher until a
program that joins has opened its end, at times for 0.34 s (a third of its health check), and the hand is vented after
0.1 s. So where only this machine is to be heard, nodes use UDP on the loopback interface alone.
"""

from __future__ import annotations

from collections.abc import MutableMapping
from pathlib import Path

ANYWHERE, LOOPBACK = "fastdds.xml", "fastdds_loopback.xml"
PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
FROM_FILE = "RMW_FASTRTPS_USE_QOS_FROM_XML"
IN_WORKING_FOLDER = "DEFAULT_FASTRTPS_PROFILES.xml"
RANGE, PEERS, ONLY_LOCAL = "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS", "ROS_LOCALHOST_ONLY"


def use_profiles(profiles: Path, environment: MutableMapping[str, str], folder: Path) -> bool:
    """Let Fast DDS use our profiles, before it is started; False where the user has profiles, or ours are not there.

    profiles: the folder that has ours.  folder: the working folder, where Fast DDS looks for a file of its own.
    """
    given = any(name in environment for name in (*PROFILES, FROM_FILE)) or (folder / IN_WORKING_FOLDER).exists()
    local = _only_this_machine(environment)
    file = profiles / (LOOPBACK if local else ANYWHERE)
    if given or not file.is_file():
        return False
    environment[PROFILES[0]] = str(file)
    environment[FROM_FILE] = "1"
    if local:
        environment[RANGE] = "SYSTEM_DEFAULT"  # for LOCALHOST, ROS 2 would add shared memory to the transports
    return True


def _only_this_machine(environment: MutableMapping[str, str]) -> bool:
    """Whether the user asked for this machine alone, in the way of ROS 2 Jazzy and with nothing besides."""
    besides = environment.get(PEERS, "") or environment.get(ONLY_LOCAL, "0") != "0"
    return environment.get(RANGE, "").upper() == "LOCALHOST" and not besides
