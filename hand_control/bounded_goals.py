"""Goals of follow_joint_trajectory whose size is checked before Python objects are made of them.

rclpy converts a whole request before any callback sees it, which takes seconds for 10^6 points. The generated class of
the request has the function that converts it, so that this module puts a check of the sizes in front of it: a request
that is too large is converted without its lists, and the node learns what is too large. The sizes are read from the
C structure (rosidl_generator_c); where a trial shows another structure, rclpy converts as usual.
"""

from __future__ import annotations

import ctypes
import importlib
from collections.abc import Callable
from typing import Any

import numpy as np

from hand_messages.bounds import MAX_NAMES
from hand_messages.commands import LISTS, MAX_POINTS

KEPT = 32
"""Most refused requests that are remembered; each is asked for at once."""


class _List(ctypes.Structure):
    """A sequence or a string: its data, its size and its capacity."""

    _fields_ = (("data", ctypes.c_void_p), ("size", ctypes.c_size_t), ("capacity", ctypes.c_size_t))


class _Header(ctypes.Structure):
    _fields_ = (("sec", ctypes.c_int32), ("nanosec", ctypes.c_uint32), ("frame_id", _List))


class _Trajectory(ctypes.Structure):
    _fields_ = (("header", _Header), ("joint_names", _List), ("points", _List))


class _Point(ctypes.Structure):
    _fields_ = (
        *((field, _List) for field in LISTS),
        ("sec", ctypes.c_int32),
        ("nanosec", ctypes.c_uint32),
    )


_TOLERANCES = ("path_tolerance", "component_path_tolerance", "goal_tolerance", "component_goal_tolerance")


class _Request(ctypes.Structure):
    _fields_ = (
        ("goal_id", ctypes.c_ubyte * 16),
        ("trajectory", _Trajectory),
        ("multi_dof_trajectory", _Trajectory),
        *((field, _List) for field in _TOLERANCES),
    )


def _sizes(values: _List, kind: type[ctypes.Structure]) -> np.ndarray[Any, np.dtype[np.uint64]]:
    """Sizes (entries, lists of an entry) of the lists that begin each entry of a sequence."""
    lists = sum(field[1] is _List for field in kind._fields_) if kind is not _List else 1
    if not values.size:
        return np.zeros((0, lists), np.uint64)
    words = ctypes.sizeof(kind) // 8
    raw = (ctypes.c_uint64 * (words * values.size)).from_address(values.data or 0)
    return np.frombuffer(raw, np.uint64).reshape(values.size, words)[:, 1 : 3 * lists : 3]


def counts(request: _Request) -> tuple[tuple[str, _List, int], ...]:
    """The lists of a request: what they hold, the list, and how many entries are allowed."""
    trajectory, other = request.trajectory, request.multi_dof_trajectory
    return (
        ("points", trajectory.points, MAX_POINTS),
        ("joint_names", trajectory.joint_names, MAX_NAMES),
        ("points of multi_dof_trajectory", other.points, MAX_NAMES),
        ("joint_names of multi_dof_trajectory", other.joint_names, MAX_NAMES),
        *((name, getattr(request, name), MAX_NAMES) for name in _TOLERANCES),
    )


def excess(request: _Request) -> str:
    """What of a request is too large, in words; empty where nothing is."""
    for what, values, most in counts(request):
        if values.size > most:
            return f"it has {values.size} {what}; at most {most} are allowed"
    longest = int(_sizes(request.trajectory.points, _Point).max(initial=0))
    return f"a point has a list of {longest} values; at most {MAX_NAMES} are allowed" if longest > MAX_NAMES else ""


class GoalBounds:
    """The check of the requests of one process."""

    def __init__(self) -> None:
        """Check nothing until `install`."""
        self._refused: dict[bytes, str] = {}
        self._kept: list[object] = []  # what C calls must not be collected

    def install(self, action: Any) -> bool:
        """Check the goals of an action of this generated class from now on; False where their structure is another one.

        The support of the class is loaded already, as by an action server.
        """
        if self._kept:
            return True
        request = action.Impl.SendGoalService.Request
        meta: Any = type(request)
        if not _as_expected(_trial(request), meta):
            return False
        before = meta._CONVERT_TO_PY
        convert = _function(before, ctypes.py_object, ctypes.c_void_p)
        bounded = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p)(lambda at: self._convert(at, convert))
        new = ctypes.pythonapi.PyCapsule_New
        new.restype, new.argtypes = ctypes.py_object, (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)
        self._kept += [before, bounded]
        meta._CONVERT_TO_PY = new(ctypes.cast(bounded, ctypes.c_void_p), None, None)
        return True

    def refusal(self, goal_id: bytes) -> str:
        """What of a request was too large, once; empty where it was converted whole."""
        return self._refused.pop(goal_id, "")

    def _convert(self, address: int, convert: Callable[[int], Any]) -> Any:
        request = _Request.from_address(address)
        line = excess(request)
        if not line:
            return convert(address)
        while len(self._refused) >= KEPT:
            del self._refused[next(iter(self._refused))]
        self._refused[bytes(request.goal_id)] = line
        lists = [values for _, values, _ in counts(request)]
        sizes = [values.size for values in lists]
        try:
            for values in lists:
                values.size = 0
            return convert(address)
        finally:
            for values, size in zip(lists, sizes, strict=True):  # the middleware frees what it has allocated
                values.size = size


def _function(capsule: object, result: Any, *arguments: Any) -> Callable[..., Any]:
    """The C function in a capsule, called with the interpreter's lock held."""
    pointer = ctypes.pythonapi.PyCapsule_GetPointer
    pointer.restype, pointer.argtypes = ctypes.c_void_p, (ctypes.py_object, ctypes.c_char_p)
    return ctypes.PYFUNCTYPE(result, *arguments)(pointer(capsule, None))  # type: ignore[no-any-return]


def _trial(request: Any) -> Any:
    """A request whose lists all have different numbers of entries."""
    trial = request()
    trial.goal_id.uuid = list(range(16))
    goal, other = trial.goal, trial.goal.multi_dof_trajectory
    goal.trajectory.joint_names = ["a", "long"]
    point = _kind_of_entries(goal.trajectory, "points")
    full = point(**{field: [0.0] * length for length, field in enumerate(LISTS, 1)})
    goal.trajectory.points = [full, point(), full]
    other.joint_names, other.points = ["a"] * 4, [_kind_of_entries(other, "points")()] * 5
    for length, field in enumerate(_TOLERANCES, 6):
        setattr(goal, field, [_kind_of_entries(goal, field)()] * length)
    return trial


def _kind_of_entries(message: Any, field: str) -> Any:
    """The generated class of the entries of a list of messages."""
    kind = message.get_fields_and_field_types()[field]  # such as sequence<control_msgs/JointTolerance>
    package, _, name = kind.removeprefix("sequence<").removesuffix(">").partition("/")
    return getattr(importlib.import_module(f"{package}.msg"), name)


def _as_expected(trial: Any, meta: Any) -> bool:
    """Whether the trial, converted to C, has the sizes of its lists where this module looks for them."""
    made = _function(meta._CREATE_ROS_MESSAGE, ctypes.c_void_p)()
    try:
        if not _function(meta._CONVERT_FROM_PY, ctypes.c_bool, ctypes.py_object, ctypes.c_void_p)(trial, made):
            return False
        goal, request = trial.goal, _Request.from_address(made)
        other = goal.multi_dof_trajectory
        lists = (goal.trajectory.points, goal.trajectory.joint_names, other.points, other.joint_names)
        want = [len(values) for values in (*lists, *(getattr(goal, name) for name in _TOLERANCES))]
        points = [[len(getattr(point, field)) for field in LISTS] for point in goal.trajectory.points]
        names = [[len(name)] for name in goal.trajectory.joint_names]
        return (
            bytes(request.goal_id) == bytes(trial.goal_id.uuid)
            and [values.size for _, values, _ in counts(request)] == want
            and _sizes(request.trajectory.points, _Point).tolist() == points
            and _sizes(request.trajectory.joint_names, _List).tolist() == names
        )
    finally:
        _function(meta._DESTROY_ROS_MESSAGE, None, ctypes.c_void_p)(made)
