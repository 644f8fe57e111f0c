"""Topics carry the stamps of clocks that differ.

The loop that runs the stages on measured inputs shifts its inputs by these parameters; no hook is needed.
"""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.kernel.plant_rows import Parameter

EFFECT = Effect(
    name="clock_offset",
    place="timing",
    needs=("two_clocks",),
    parameters=(
        Parameter("clock_offset.offset_s", -0.2, 0.2, "stamp of pressures minus that of angles", 1.0, 0.0, 0.01),
        Parameter(
            "clock_offset.share",
            0.0,
            1.0,
            "of it against the set-points: 1 where they share the angles' clock",
            1.0,
            1.0,
            0.17,
        ),
    ),
    keys=("clock_offset.offset_s", "clock_offset.share"),
    probes=((0.01, 1.0), (-0.01, 1.0), (0.03, 1.0), (-0.03, 1.0), (0.03, 0.0), (-0.03, 0.0)),
    shape=("clock_offset.share",),
    says="the time stamps of the {pressure} are {offset_s} late against those of the {angle}, and {share} of"
    " that against those of the set-points",
    shared=(
        "clock_offset.offset_s",
        "clock_offset.share",
    ),
    experiments=("steps", "multisine"),
    doc="A constant difference between the clocks of two topics, the same at every joint.",
    source="definition",
    everywhere=True,
    constitution=Constitution(
        acts_on="stamps of the pressures",
        sign="early or late",
        monotone="a shift in time",
        over=("time",),
        source="REP-103 stamps; Mills, Computer Network Time Synchronization, 2011",
    ),
)
