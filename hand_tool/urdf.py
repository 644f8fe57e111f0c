"""`hand urdf`: the hand as URDF, SRDF or MJCF for other programs, and layouts of viewers for its topics."""

from __future__ import annotations

import sys
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hand_tool.chosen_model import choose_model
from hand_tool.console import note, running
from hand_tool.options import Model, Quiet, Verbose
from hand_tool.paths import check_file, check_new

if TYPE_CHECKING:
    from hand_model.description import Hand


class Format(Enum):
    """What is written."""

    URDF = "urdf"
    XACRO = "xacro"
    SRDF = "srdf"
    MJCF = "mjcf"
    FOXGLOVE = "foxglove"
    PLOTJUGGLER = "plotjuggler"
    RVIZ = "rviz"


class Control(Enum):
    """The hardware interface of ros2_control."""

    NONE = "none"
    TOPIC_BASED = "topic_based"
    MUJOCO = "mujoco"


def urdf(
    *,
    out: Annotated[Path | None, typer.Option(help="New file. Default: standard output.")] = None,
    form: Annotated[
        Format,
        typer.Option(
            "--format", help="xacro: a macro of both hands. mjcf: for MuJoCo. The last three: layouts of viewers."
        ),
    ] = Format.URDF,
    prefix: Annotated[
        str, typer.Option(help="Beginning of every name, such as left_; replaces joint_prefix of the model.")
    ] = "",
    mount: Annotated[str, typer.Option(help="Parent link of the hand, such as tool0. Default: none.")] = "",
    mount_xyz: Annotated[
        tuple[float, float, float], typer.Option(help="Position of the hand in the frame of the mount [m].")
    ] = (0.0, 0.0, 0.0),
    mount_rpy: Annotated[
        tuple[float, float, float], typer.Option(help="Roll, pitch and yaw in the frame of the mount [rad].")
    ] = (0.0, 0.0, 0.0),
    ros2_control: Annotated[
        Control, typer.Option("--ros2-control", help="Tags for ros2_control in the URDF.")
    ] = Control.NONE,
    namespace: Annotated[str, typer.Option(help="Namespace of the hand's topics, for topic_based.")] = "hand",
    mujoco_model: Annotated[str, typer.Option(help="Path of the MJCF, for mujoco.")] = "hand.xml",
    grasps: Annotated[
        Path | None,
        typer.Option(help="Grasp patterns of the SRDF's named states. Default: grasps.yaml next to the model."),
    ] = None,
    model: Model = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Write the hand as URDF, xacro, SRDF, MJCF or a viewer's layout, from `geometry` in hand.yaml.

    Example: hand urdf --prefix left_ --mount tool0 --ros2-control topic_based --out left_hand.urdf

    Exit codes: 0 done, 2 bad usage or a model without geometry.
    """
    with running("urdf", *([out] if out else [])) as outputs:
        if out is not None:
            check_new(out, "models")
        _check_names(prefix, mount, namespace)
        chosen = choose_model(model)
        patterns = check_file(grasps or chosen.path.with_name("grasps.yaml")) if form is Format.SRDF else None
        chosen.print()
        from hand_model.description import load_hand

        hand = load_hand(chosen.path, prefix)
        if form in (Format.URDF, Format.XACRO):
            from hand_robot.urdf import Mount, macro_text, urdf_text

            where = Mount(mount, mount_xyz, mount_rpy)
            urdf = form is Format.URDF
            text = urdf_text(hand, where, ros2_control.value, namespace, mujoco_model) if urdf else macro_text(hand)
        else:
            text = _text(form, hand, patterns, mount, namespace)
        if out is None:
            sys.stdout.write(text)
            return
        out.write_text(text, encoding="utf-8")
        outputs.complete(out)
        note(f"{form.value} written to {out}")


def _text(form: Format, hand: Hand, patterns: Path | None, mount: str, namespace: str) -> str:
    """The text of every format but URDF and xacro."""
    from hand_control.grasps import load_grasps
    from hand_robot import layouts
    from hand_robot.mjcf import mjcf_text
    from hand_robot.srdf import srdf_text

    if form is Format.SRDF and patterns is not None:
        return srdf_text(hand, load_grasps(patterns, hand), mount)
    if form is Format.MJCF:
        return mjcf_text(hand)
    makers = {Format.FOXGLOVE: layouts.foxglove_text, Format.PLOTJUGGLER: layouts.plotjuggler_text}
    return makers.get(form, layouts.rviz_text)(hand, namespace)


def _check_names(prefix: str, mount: str, namespace: str) -> None:
    """Names that XML, TF and ROS accept. Raises ValueError, one line."""
    for option, value, more in (("prefix", prefix, "_"), ("mount", mount, "_"), ("namespace", namespace, "_/")):
        plain = value
        for letter in more:
            plain = plain.replace(letter, "")
        if value and not (plain.isascii() and plain.isalnum()):
            raise ValueError(f"--{option} is {value!r}; it must consist of letters, digits and underscores")
