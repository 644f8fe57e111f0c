"""docs/nodes.md: the parameters of the nodes and the arguments of their launch files, from their declarations."""

from __future__ import annotations

from typing import Any

from hand_ros.parameters import NodeParameter


def parameters() -> str:
    """A section for each node but the controller, whose table is in docs/control.md."""
    from hand_driver.node import COMMON_PARAMETERS, PARAMETERS  # noqa: PLC0415 - these modules import rclpy
    from hand_recording.node import PARAMETERS as RECORDER  # noqa: PLC0415 - as above
    from hand_robot.node import PARAMETERS as FRAMES  # noqa: PLC0415 - as above
    from hand_ros.node import AUTOSTART, EXIT_UNCONFIGURED  # noqa: PLC0415 - as above
    from hand_sim.node import PARAMETERS as SIMULATION  # noqa: PLC0415 - as above

    tables = {
        "Every node but the recorder": (AUTOSTART, EXIT_UNCONFIGURED),
        "`driver` and `simulation`": COMMON_PARAMETERS,
        "`driver`": PARAMETERS[len(COMMON_PARAMETERS) :],
        "`simulation`": SIMULATION[len(COMMON_PARAMETERS) :],
        "`frame_publisher`": FRAMES,
        "`recorder`": RECORDER,
    }
    return "\n\n".join(f"### {title}\n\n{_table(table)}" for title, table in tables.items())


def _table(table: tuple[NodeParameter, ...]) -> str:
    rows = ["| parameter | default | range | meaning |", "|---|---|---|---|"]
    for each in table:
        allowed = ", ".join(each.choices)
        if each.low is not None and each.high is not None:
            allowed = f"{each.low:.10g} to {each.high:.10g}"
        rows.append(f"| `{each.name}` | {_shown(each.default)} | {allowed} | {each.description} |")
    return "\n".join(rows)


def _shown(default: Any) -> str:
    if default in ("", [""]):
        return ""
    return f"`{str(default).lower()}`" if isinstance(default, bool) else f"`{default}`"


def arguments() -> str:
    """The arguments of the launch files."""
    from hand_robot.launch_nodes import ARGUMENTS  # noqa: PLC0415 - only here

    rows = ["| argument | default | meaning |", "|---|---|---|"]
    rows += [f"| `{each.name}` | {_shown(each.default)} | {each.description} |" for each in ARGUMENTS]
    return "\n".join(rows)
