"""`hand identify`: parameters from rigs and recordings."""

from __future__ import annotations

import typer

from hand_tool.identify_angle import angle
from hand_tool.identify_dynamics import dynamics
from hand_tool.identify_force import force
from hand_tool.identify_statics import statics

app = typer.Typer(
    no_args_is_help=True,
    help="Identify sensors, static map, dynamics and material from rig files and recordings.\n\n"
    "Example: hand identify dynamics recording.mcap --out out/identified",
)
for command in (angle, force, statics, dynamics):
    app.command()(command)
