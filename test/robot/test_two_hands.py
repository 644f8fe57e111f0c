"""The example with two hands: its URDF by xacro, and the arguments that its launch file gives."""

from __future__ import annotations

import io
import sys
import types
from pathlib import Path
from typing import Any

import pytest
import xacro
import yourdfpy

from test.robot.fake_launch import declared, names_of

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "two_hands"
MACRO = str(ROOT / "urdf" / "hand_macro.xacro")


def robot(arm_prefix: str) -> Any:
    mappings = {"arm_prefix": arm_prefix, "hand_macro": MACRO}
    text = xacro.process_file(str(EXAMPLE / "two_hands.urdf.xacro"), mappings=mappings).toxml()
    return yourdfpy.URDF.load(io.BytesIO(text.encode()), load_meshes=False)


@pytest.mark.parametrize("arm_prefix", ["", "robot1_"])
def test_the_urdf_has_a_left_and_a_right_hand(arm_prefix: str) -> None:
    """Fails when both hands are of one side, share a name, or hang on the wrong arm."""
    made = robot(arm_prefix)
    assert made.validate(), made.errors
    assert made.base_link == f"{arm_prefix}torso" and len(made.actuated_joint_names) == 22
    assert all(name.startswith(arm_prefix) for name in made.actuated_joint_names)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        palm = made.get_transform(f"{arm_prefix}{side}_palm", f"{arm_prefix}torso")
        assert palm[1, 3] == pytest.approx(sign * 0.3)
        thumb = made.get_transform(f"{arm_prefix}{side}_thumb_tip", f"{arm_prefix}torso")
        # With the palms down, both thumbs point to the middle of the body.
        assert (thumb[1, 3] - palm[1, 3]) * sign < -0.05


@pytest.mark.parametrize("simulated", ["true", "false"])
def test_the_launch_gives_arguments_that_the_included_files_declare(
    simulated: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fails when an argument does not exist, or namespace, prefix and URDF do not fit together."""
    functions = names_of(EXAMPLE / "two_hands.launch.py", monkeypatch)
    stand_in: Any = types.ModuleType("xacro")
    stand_in.process_file = lambda path, mappings: xacro.process_file(path, mappings=mappings | {"hand_macro": MACRO})
    functions["hands"].__globals__["xacro"] = stand_in
    (description,) = functions["generate_launch_description"]().arguments
    arguments = declared(description)
    assert all(named["description"] for named in arguments.values())
    context = {name: named["default_value"] for name, named in arguments.items()}
    actions = functions["hands"](context | {"arm_prefix": "robot1_", "simulated": simulated})
    name = "simulated_hand.launch.py" if simulated == "true" else "hand.launch.py"
    included = [action for action in actions if type(action).__name__ == "IncludeLaunchDescription"]
    assert len(included) == 2
    (known,) = names_of(ROOT / "launch" / name, monkeypatch)["generate_launch_description"]().arguments
    for side, action in zip(("left", "right"), included, strict=True):
        given = dict(action.named["launch_arguments"])
        assert set(given) <= set(declared(known))
        assert given["namespace"] == f"robot1_{side}_hand" and given["joint_prefix"] == f"robot1_{side}_"
        assert given["robot_state_publisher"] == "false"
        assert action.arguments[0].arguments[0].arguments[0][-1] == name
    publisher = next(action for action in actions if action.named.get("package") == "joint_state_publisher")
    text, sources = publisher.named["parameters"]
    assert sources["source_list"] == [f"/robot1_{side}_hand/joint_states" for side in ("left", "right")]
    assert 'name="robot1_left_index_proximal"' in text["robot_description"].arguments[0]
    assert "xacro" in sys.modules
