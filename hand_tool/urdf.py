"""`hand urdf`: the hand for other programs, as models, settings of ros2_control and MoveIt, and layouts of viewers."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hand_tool.chosen_model import choose_model
from hand_tool.console import note, running
from hand_tool.options import Model, Quiet, Verbose
from hand_tool.paths import check_file, check_new

if TYPE_CHECKING:
    from hand_robot.srdf import Placed
    from hand_robot.urdf import Mount


class Format(Enum):
    """What is written."""

    URDF = "urdf"
    XACRO = "xacro"
    SRDF = "srdf"
    MJCF = "mjcf"
    CONTROLLERS = "controllers"
    MOVEIT = "moveit"
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
    out: Annotated[
        Path | None, typer.Option(help="New file; for moveit a new folder. Default: standard output.")
    ] = None,
    form: Annotated[
        Format,
        typer.Option(
            "--format",
            help="xacro: a macro of both hands. mjcf: for MuJoCo. controllers: parameters of ros2_control. "
            "moveit: SRDF, limits, kinematics and controllers. The last three: layouts of viewers.",
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
        Control,
        typer.Option(
            "--ros2-control", help="Tags for ros2_control in the URDF. mujoco, with mjcf: servos for these tags."
        ),
    ] = Control.NONE,
    namespace: Annotated[
        str, typer.Option(help="Namespace of the hand's topics, for topic_based, moveit and layouts.")
    ] = "hand",
    mujoco_model: Annotated[str, typer.Option(help="Path of the MJCF, for mujoco.")] = "hand.xml",
    grasps: Annotated[
        Path | None,
        typer.Option(
            help="Grasp patterns: the named states of srdf and moveit. Default: grasps.yaml next to the model."
        ),
    ] = None,
    hands: Annotated[
        str,
        typer.Option(
            help="With srdf and moveit: hands of one robot, such as left,right. Names begin with PREFIX and left_; the"
            " namespace is then PREFIXleft_hand, and the mount PREFIXleft_MOUNT."
        ),
    ] = "",
    robot: Annotated[
        str, typer.Option(help="Name of the robot in its URDF, for srdf and moveit. Default: that of the hand.")
    ] = "",
    model: Model = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Write the hand as URDF, xacro, SRDF, MJCF, settings of ros2_control or MoveIt, or a viewer's layout.

    Example: hand urdf --prefix left_ --mount tool0 --ros2-control topic_based --out left_hand.urdf

    Exit codes: 0 done, 2 bad usage or a model without geometry.
    """
    with running("urdf", *([out] if out else [])) as outputs:
        if out is not None:
            check_new(out, "models")
        elif form is Format.MOVEIT:
            raise ValueError("--format moveit writes several files; --out must name a new folder")
        sides = _sides(hands)
        _check_names(("prefix", prefix), ("mount", mount), ("robot", robot), *(("hands", side) for side in sides))
        _check_names(("namespace", namespace), more="_/")
        chosen = choose_model(model)
        with_grasps = form in (Format.SRDF, Format.MOVEIT)
        if (hands or robot) and not with_grasps:
            raise ValueError("--hands and --robot need --format srdf or moveit")
        patterns = check_file(grasps or chosen.path.with_name("grasps.yaml")) if with_grasps else None
        chosen.print()
        from hand_robot.urdf import Mount

        begin, topics = [f"{prefix}{side}_" for side in sides], namespace.strip("/")
        names = [(each, each + topics, mount and each + mount) for each in begin] or [(prefix, namespace, mount)]
        placed = _placed(chosen.path, patterns, names)
        where = Mount(mount, mount_xyz, mount_rpy)
        texts = _texts(form, placed, where, robot, ros2_control, mujoco_model)
        if out is None:
            sys.stdout.write(texts[""])
            return
        for name, text in texts.items():
            file = out / name if name else out
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")
        outputs.complete(out)
        note(f"{form.value} written to {out}")


def _placed(path: Path, patterns: Path | None, names: Sequence[tuple[str, str, str]]) -> list[Placed]:
    """A hand for each prefix, namespace and mount; with grasps where their file is given."""
    from hand_control.grasps import load_grasps
    from hand_model.description import load_hand
    from hand_robot.srdf import Placed

    made = []
    for prefix, namespace, mount in names:
        hand = load_hand(path, prefix)
        made.append(Placed(hand, load_grasps(patterns, hand) if patterns else {}, namespace, mount))
    return made


def _texts(
    form: Format, placed: Sequence[Placed], mount: Mount, robot: str, control: Control, mujoco_model: str
) -> dict[str, str]:
    """The texts by the name of the file; a format of one file has no name. Most formats are of the first hand."""
    from hand_model.yaml_document import yaml_text
    from hand_robot import layouts
    from hand_robot.mjcf import mjcf_text
    from hand_robot.moveit import moveit_files
    from hand_robot.ros2_control import controllers
    from hand_robot.srdf import srdf_text
    from hand_robot.urdf import macro_text, urdf_text

    if form is Format.MOVEIT:
        return moveit_files(placed, robot)
    hand, namespace = placed[0].hand, placed[0].namespace
    makers: dict[Format, Callable[[], str]] = {
        Format.URDF: lambda: urdf_text(hand, mount, control.value, namespace, mujoco_model),
        Format.XACRO: lambda: macro_text(hand),
        Format.SRDF: lambda: srdf_text(placed, robot),
        Format.MJCF: lambda: mjcf_text(hand, servos=control is Control.MUJOCO),
        Format.CONTROLLERS: lambda: yaml_text(controllers(hand)),
        Format.FOXGLOVE: lambda: layouts.foxglove_text(hand, namespace),
        Format.PLOTJUGGLER: lambda: layouts.plotjuggler_text(hand, namespace),
        Format.RVIZ: lambda: layouts.rviz_text(hand, namespace),
    }
    return {"": makers[form]()}


def _sides(hands: str) -> list[str]:
    """The names of --hands. Raises ValueError, one line, for a name that is empty or there twice."""
    sides = [name.strip() for name in hands.split(",")] if hands else []
    if "" in sides or len(set(sides)) < len(sides):
        raise ValueError(f"--hands is {hands!r}; it must be different names with commas between them")
    return sides


def _check_names(*given: tuple[str, str], more: str = "_") -> None:
    """Names that XML, TF and ROS accept, by their option. more: letters besides. Raises ValueError, one line."""
    for option, value in given:
        plain = value
        for letter in more:
            plain = plain.replace(letter, "")
        if value and not (plain.isascii() and plain.isalnum()):
            raise ValueError(f"--{option} is {value!r}; it must consist of letters, digits and underscores")
