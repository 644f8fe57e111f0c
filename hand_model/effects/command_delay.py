"""A command acts after a dead time: of a bus, a computer, or a network.

The loop that runs the stages on recorded inputs shifts them by this parameter; no hook is needed.
"""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.kernel.plant_rows import Parameter

EFFECT = Effect(
    name="command_delay",
    place="timing",
    needs=("drive",),
    parameters=(Parameter("command_delay.dead_time_s", 0.0, 0.5, "from a command to its action", 1.0, 0.0, 0.01),),
    keys=("command_delay.dead_time_s",),
    probes=((0.004,), (0.012,), (0.04,), (0.12,)),
    says="the {pressure} acts after a dead time of {dead_time_s}",
    experiments=("steps", "multisine"),
    doc="Dead time between a command and its action, as of a bus or a computer.",
    source="pure transport delay, Ljung, System Identification, 1999",
    constitution=Constitution(
        acts_on="input of the drive",
        sign="late",
        monotone="a shift in time",
        memory="the commands of the dead time",
        over=("time",),
        source="pure transport delay, Ljung, System Identification, 1999",
    ),
)
