"""The hand in MuJoCo: mechanics that nobody here wrote, under the pressures of simple valves.

Bodies, masses, attitude and joints are those of the MJCF that `hand urdf --format mjcf` writes. A valve is a dead time
before MuJoCo's own filter; the pressure acts through the affine actuators (Eq. 6), and the creep of Eqs. 11-13 is an
applied torque. What is concealed are MuJoCo's own means: dry friction, polynomial damping and stiffness, armature,
weight under any attitude of the palm, joint limits, tendons between fingers, contact with an object; and two effects
of the drive, a second pole of the valve and another dead time.

Not as in the nominal model, and not concealed: the inertia of a finger depends on its shape (13.6 to 9.5e-5 kg m^2 at
the base of the index finger), limits are MuJoCo's soft constraints, and the two phalanges of a finger act on each other
by their masses, not by a constant coupling inertia. The thumb stays at rest and is not recorded: flexion changes the
inertia about its opposition sixfold, which is physics that the nominal model does not have.
Source: Todorov, Erez, Tassa 2012; MuJoCo's documentation, "Computation".
"""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from validation.referees.conditions import Conditions, draw
from validation.referees.make import (
    COMMAND_FRAMES,
    USUAL,
    Case,
    kinds_in_order,
    planned_and_sealed,
    true_rows,
    write_recording,
)
from validation.referees.plant import FRAME_S
from validation.referees.shapes import Rng
from validation.trial.arrays import Array
from validation.trial.limits import OUTPUT, SKIP_S, Projector, rms
from validation.trial.make import all_made
from validation.trial.motions import EXPERIMENTS, set_points
from validation.trial.nominal import Nominal
from validation.trial.plant import ROW

STEP_S = 0.0005
KINDS = {"single": 0.6, "null": 0.2, "several": 0.2}
MULTIPLES = (2.0, 5.0)
"""Sizes, in detection limits (validation/trial/limits.py)."""
TRIAL_S = 12.0
"""Length of the simulations that look for a size."""
HALVINGS = 12
"""Of the range of a size: a limit or an object is met over fractions of a degree."""
GRAVITY_M_S2 = 9.81
OBJECT_M, CLEARANCE_M, TOUCHES_AT = 0.008, 0.0005, 0.8
"""Radius of an object, its distance from the finger at the angle where they meet, and where along the half link."""


@dataclass(slots=True)
class Plant:
    """A hand in MuJoCo: spec, to be changed before it is compiled; true constants q (rows, joints) of the drive.

    more_lag_s, more_delay_s: (joints,) of further valve poles and dead times.
    """

    spec: Any
    q: Array
    joints: list[str]
    more_lag_s: Array
    more_delay_s: Array


@dataclass(frozen=True, slots=True)
class Means:
    """An effect by one of MuJoCo's own means, or of the drive.

    apply: (plant, joint, size, rng) changes the plant.  least, most: sizes between which the size is sought, in the
    unit of the means.  stage: 0 pressure, 1 angle.  group: names that are right.  alone: only this joint moves.
    possible: names of joints end with one of these; all where empty.
    """

    name: str
    effect: str
    place: str
    apply: Callable[[Plant, int, float, Rng], None]
    least: float
    most: float
    stage: int = 1
    group: tuple[str, ...] = ()
    alone: bool = False
    possible: tuple[str, ...] = ()


Concealed = tuple[Means, int]
"""An effect and the seed of what it draws."""


@dataclass(frozen=True, slots=True)
class Scene:
    """A joint of a hand in a motion, for the detection limit.

    q: true constants (rows, joints).  u: set-points (frames, joints) [Pa].  joint: its column.
    """

    nominal: Nominal
    model: Path
    q: Array
    u: Array
    joint: int
    frame_s: float = FRAME_S

    def readings(self, concealed: Concealed | None, size: float, **changes: float) -> Array:
        """Pressure, angle and force (3, frames) of the joint with an effect; changes: factors on its rows.

        RuntimeError where MuJoCo diverges.
        """
        q = self.q.copy()
        for name, factor in changes.items():
            q[ROW[name], self.joint] *= factor
        plant = plant_of(self.nominal, self.model, q)
        if concealed is not None:
            means, seed = concealed
            means.apply(plant, self.joint, size, np.random.default_rng(seed))
        seen: Array = simulate(plant, self.u)[list(OUTPUT), :, self.joint][:, round(SKIP_S / self.frame_s) :]
        return seen


def _friction(plant: Plant, joint: int, size: float, rng: Rng) -> None:
    plant.spec.joint(plant.joints[joint]).frictionloss += size


def _damping(plant: Plant, joint: int, size: float, rng: Rng) -> None:
    element = plant.spec.joint(plant.joints[joint])
    element.damping = np.array(element.damping) + np.array([0.0, size, 0.0])


def _spring(plant: Plant, joint: int, size: float, rng: Rng) -> None:
    """A spring whose torque rises with the square of the deflection from its rest angle, and whose rest is drawn."""
    element = plant.spec.joint(plant.joints[joint])
    element.springref = 0.0
    element.stiffness = np.array([0.0, 0.0, size])


def _armature(plant: Plant, joint: int, size: float, rng: Rng) -> None:
    plant.spec.joint(plant.joints[joint]).armature += size


def _weight(plant: Plant, joint: int, size: float, rng: Rng) -> None:
    """The weight of a link, `size` times its own, under the attitude of the palm; its inertia stays."""
    direction = rng.standard_normal(3)
    plant.spec.option.gravity = GRAVITY_M_S2 * direction / np.linalg.norm(direction)
    plant.spec.body(f"{plant.joints[joint]}_link").gravcomp = 1.0 - size


def _limit(plant: Plant, joint: int, size: float, rng: Rng) -> None:
    """A joint limit that is nearer by `size` [rad]."""
    element = plant.spec.joint(plant.joints[joint])
    low, high = element.range
    element.range = [low, high - size]


def _tendon(plant: Plant, joint: int, size: float, rng: Rng) -> None:
    """An elastic tendon [N m/rad] between a joint and the same joint of the next finger."""
    tendon = plant.spec.add_tendon(name="between")
    tendon.wrap_joint(plant.joints[joint], 1.0)
    tendon.wrap_joint(plant.joints[next_finger(plant.joints, joint)], -1.0)
    tendon.stiffness = np.array([size, 0.0, 0.0])
    tendon.springlength = [0.0, 0.0]


def _object(plant: Plant, joint: int, size: float, rng: Rng) -> None:
    """A round object fixed in the way of a finger, which it meets `size` [rad] before its upper limit."""
    import mujoco  # noqa: PLC0415 - not needed to load the recordings

    name = plant.joints[joint]
    model = plant.spec.copy().compile()
    data = mujoco.MjData(model)
    data.qpos[:] = -plant.q[ROW["a0"]] / plant.q[ROW["a1"]]
    data.qpos[joint] = model.joint(name).range[1] - size
    geom = next(k for k in range(model.ngeom) if model.geom_bodyid[k] == model.body(f"{name}_link").id)
    tips = []
    for _ in range(2):
        mujoco.mj_kinematics(model, data)
        axis = data.geom_xmat[geom].reshape(3, 3)[:, 2]
        tips.append(data.geom_xpos[geom] + TOUCHES_AT * model.geom_size[geom][1] * axis)
        data.qpos[joint] += 1e-4
    tip, way = tips[0], (tips[1] - tips[0]) / np.linalg.norm(tips[1] - tips[0])
    next(iter(plant.spec.body(f"{name}_link").geoms)).name = "finger"
    at = tip + way * (OBJECT_M + float(model.geom_size[geom][0]) + CLEARANCE_M)
    sphere = plant.spec.worldbody.add_geom(name="object", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[OBJECT_M, 0, 0])
    sphere.pos, sphere.contype, sphere.conaffinity = at, 0, 0
    plant.spec.add_pair(name="meeting", geomname1="finger", geomname2="object")


def _pole(plant: Plant, joint: int, size: float, rng: Rng) -> None:
    plant.more_lag_s[joint] += size


def _delay(plant: Plant, joint: int, size: float, rng: Rng) -> None:
    plant.more_delay_s[joint] += size


MEANS: tuple[Means, ...] = (
    Means("frictionloss", "coulomb_friction", "joint", _friction, 1e-5, 0.05),
    Means("quadratic damping", "viscous_friction", "joint", _damping, 1e-5, 0.05),
    Means("cubic stiffness", "stiffening", "material", _spring, 1e-4, 0.1),
    Means("armature", "added_inertia", "joint", _armature, 1e-6, 2e-3),
    Means("weight of a link", "gravity", "joint", _weight, 0.01, 30.0,
          possible=("index_proximal", "middle_proximal", "ring_proximal", "little_proximal")),
    Means("joint limit", "end_stop", "joint", _limit, 0.05, 1.6, group=("end_stop", "contact")),
    Means("object", "contact", "environment", _object, 0.05, 1.6, group=("contact", "end_stop"), alone=True,
          possible=("index_distal", "middle_distal", "ring_distal", "little_distal")),
    Means("tendon between fingers", "joint_coupling", "joint", _tendon, 1e-4, 0.1,
          possible=("index_proximal", "middle_proximal", "ring_proximal")),
    Means("second pole", "valve_lag", "valve", _pole, 1e-4, 0.15, stage=0),
    Means("dead time", "valve_delay", "valve", _delay, 1e-3, 0.05, stage=0),
)  # fmt: skip


def next_finger(joints: list[str], joint: int) -> int:
    """Column of the same joint of the next finger."""
    kind = joints[joint].rpartition("_")[2]
    return next(k for k in range(joint + 1, len(joints)) if joints[k].endswith(kind))


@cache
def mjcf(model: Path) -> str:
    """The MJCF of a hand.yaml, as `hand urdf` writes it. RuntimeError with its last line where it fails."""
    command = [sys.executable, "-m", "hand_tool", "urdf", "--format", "mjcf", "--model", str(model)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"hand urdf ended with {done.returncode}: {(done.stderr.strip().splitlines() or ['?'])[-1]}")
    return done.stdout


def plant_of(nominal: Nominal, model: Path, q: Array) -> Plant:
    """A hand without effects that has constants q (rows, joints), SI."""
    import mujoco  # noqa: PLC0415 - not needed to load the recordings

    spec = mujoco.MjSpec.from_string(mjcf(model))
    spec.option.timestep = STEP_S
    n = len(nominal.joints)
    for k, name in enumerate(nominal.joints):
        joint, drive = spec.joint(name), spec.actuator(name)
        joint.damping = [q[ROW["drag"], k], 0.0, 0.0]
        joint.armature = max(joint.armature + q[ROW["inertia"], k] - nominal.rows[ROW["inertia"], k], 0.0)
        drive.dynprm[0] = q[ROW["lag"], k]
        drive.gainprm[:2] = q[ROW["a2"], k], q[ROW["a3"], k]
        drive.biasprm[:2] = q[ROW["a0"], k], q[ROW["a1"], k]
    for geom in spec.geoms:  # fingers of a closed hand do not meet each other, only an object that is concealed
        geom.contype = geom.conaffinity = 0
    return Plant(spec, q.copy(), list(nominal.joints), np.zeros(n), np.zeros(n))


def simulate(plant: Plant, u: Array) -> Array:
    """Readings (4, frames, joints) without noise: pressure [Pa], angle [rad], speed [rad/s], force [N], which is 0.

    u: set-points (frames, joints) [Pa], the vented hand begins at rest. RuntimeError where MuJoCo diverges.
    """
    import mujoco  # noqa: PLC0415 - not needed to load the recordings
    from mujoco import rollout  # noqa: PLC0415 - as above

    model = plant.spec.compile()
    data, each = mujoco.MjData(model), round(FRAME_S / STEP_S)
    n, steps = len(plant.joints), len(u) * each
    control = _delayed(np.repeat(u, each, axis=0), plant)
    pressure, torque = _drive(control, plant)
    data.qpos[:] = np.clip(-plant.q[ROW["a0"]] / plant.q[ROW["a1"]], model.jnt_range[:, 0], model.jnt_range[:, 1])
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    start = np.zeros(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, start, kind)
    given = mujoco.mjtState.mjSTATE_CTRL.value | mujoco.mjtState.mjSTATE_QFRC_APPLIED.value
    inputs = np.concatenate([control, torque], axis=1)
    states, _ = rollout.rollout(model, data, start[None], inputs[None], control_spec=given, nstep=steps)
    seen = np.concatenate([start[None], states[0]])[:-1:each]
    if not np.isfinite(seen).all() or np.abs(seen[:, 1 : 1 + n]).max() > 4.0:
        raise RuntimeError("MuJoCo: the simulation diverged")
    angle, speed, valve = (seen[:, 1 + k * n : 1 + (k + 1) * n] for k in range(3))
    assert np.allclose(valve, pressure[::each], rtol=0.05, atol=500.0), "the creep follows another pressure"
    return np.stack([valve, angle, speed, np.zeros_like(angle)])


def _delayed(fine: Array, plant: Plant) -> Array:
    """Set-points (steps, joints) [Pa] after the dead times and the further poles of the valves."""
    out = np.empty_like(fine)
    for k in range(fine.shape[1]):
        late = round((plant.q[ROW["delay"], k] + plant.more_delay_s[k]) / STEP_S)
        column = np.concatenate([np.full(late, fine[0, k]), fine[: len(fine) - late, k]])
        out[:, k] = _filtered(column, plant.more_lag_s[k]) if plant.more_lag_s[k] > 0.0 else column
    return out


def _filtered(values: Array, tau_s: float) -> Array:
    """First-order lag of values (steps,) from 0, exact for steps."""
    from scipy.signal import lfilter  # noqa: PLC0415 - not needed to load the recordings

    share = 1.0 - math.exp(-STEP_S / tau_s)
    out: Array = lfilter([0.0, share], [1.0, share - 1.0], values)
    return out


def _drive(control: Array, plant: Plant) -> tuple[Array, Array]:
    """Pressures [Pa] as MuJoCo's filters make them, and the torque of the creep [N m], (steps, joints); Eqs. 11-13."""
    q = plant.q
    pressure = np.column_stack([_filtered(control[:, k], q[ROW["lag"], k]) for k in range(control.shape[1])])
    torque, ratio = np.empty_like(pressure), np.zeros(control.shape[1])
    p_min, b1, t_ext, b0, t_rec = (q[ROW[name]] for name in ("p_min", "b1", "t_ext", "b0", "t_rec"))
    for k, p in enumerate(pressure):
        torque[k] = ratio
        extending = np.maximum(0.0, (b1 * (p - p_min) - ratio) / t_ext)
        ratio = ratio + STEP_S * (extending + np.minimum(0.0, (b0 * p - ratio) / t_rec))
    return pressure, -torque * q[ROW["a1"]] * q[ROW["reach"]]


def sized(means: Means, where: Scene, multiple: float, seed: int) -> float | None:
    """The size [unit of the means] of an effect at a multiple of its detection limit; None where none has it.

    Of the change of the joint's signal only what wrong constants cannot imitate counts, as on the other plants.
    seed: of what the effect draws.
    """
    projector = Projector(where, means.stage)

    def seen(size: float) -> float:
        try:
            change = where.readings((means, seed), size)[means.stage] - projector.plain
        except RuntimeError:
            return math.inf
        return rms(projector.remainder(change))

    low, high = means.least, means.most
    if seen(high) < multiple:
        return None
    for _ in range(HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if seen(middle) < multiple else (low, middle)
    return high


def make_case(work: tuple[Case, str, str]) -> Case:
    """Simulate and record a case and fill in its truth; work: case, model, folder."""
    case, model, out = work
    nominal, rng = Nominal(Path(model)), np.random.default_rng(case.seed)
    how = replace(Conditions() if rng.random() < USUAL else draw(rng), onset=0.0)
    case.conditions, case.labels = asdict(how) | {"onset_s": None}, how.labels()
    seed, frames = int(rng.integers(2**31)), round(how.duration_s / FRAME_S)
    fingers = [k for k, name in enumerate(nominal.joints) if not name.startswith("thumb")]
    chosen = [MEANS[int(k)] for k in rng.permutation(len(MEANS))]
    first = int(rng.integers(len(fingers)))
    joints = sorted(fingers[k % len(fingers)] for k in range(first, first + min(how.joints, len(fingers))))
    if case.kind == "single" and chosen[0].alone:
        joints = [int(rng.choice(_able(chosen[0], nominal.joints, fingers)))]
    case.motion = str(rng.choice(EXPERIMENTS))
    u = _set_points(case.motion, frames, len(nominal.joints), joints, rng)
    q = true_rows(nominal, how.off, np.random.default_rng(seed))
    plant, short = plant_of(nominal, Path(model), q), u[: round(TRIAL_S / FRAME_S)]
    _conceal(case, plant, lambda joint: Scene(nominal, Path(model), q, short, joint), joints, chosen, rng)
    path = Path(out) / "recordings" / f"case_{case.number:04d}.mcap"
    write_recording(path, how, (simulate(plant, u), u), nominal.joints, joints, rng)
    return case


def _set_points(motion: str, frames: int, count: int, joints: list[int], rng: Rng) -> Array:
    """Set-points (frames, count) [Pa] of a motion; 0 for joints that are not among those given."""
    u = set_points(motion, -(-frames // COMMAND_FRAMES), COMMAND_FRAMES * FRAME_S, count, rng)
    u = np.repeat(u, COMMAND_FRAMES, axis=0)[:frames]
    u[:, [k for k in range(count) if k not in joints]] = 0.0
    return u


def _conceal(
    case: Case,
    plant: Plant,
    scene: Callable[[int], Scene],
    joints: list[int],
    chosen: list[Means],
    rng: Rng,
) -> None:
    """Give the plant as many effects as the case's kind asks for, each on joints of its own, and note the truth.

    scene: of a joint, for the size.  joints: those that are recorded.  A tendon takes two joints.
    """
    wanted = {"null": 0, "single": 1, "several": 2}[case.kind]
    taken = set[int]()
    for means in chosen:
        if len(case.truth) >= wanted:
            break
        able = [k for k in _able(means, plant.joints, joints) if k not in taken]
        if means.effect == "joint_coupling":
            able = [k for k in able if not taken and next_finger(plant.joints, k) in joints]
        if not able or (means.alone and len(joints) > 1):
            continue
        joint, multiple, own = int(rng.choice(able)), float(rng.choice(MULTIPLES)), int(rng.integers(2**31))
        size = sized(means, scene(joint), multiple, own)
        if size is None:
            case.unplaced.append(means.name)
            continue
        means.apply(plant, joint, size, np.random.default_rng(own))
        ends = [joint, next_finger(plant.joints, joint)] if means.effect == "joint_coupling" else [joint]
        taken.update(ends)
        case.families.append(means.name)
        case.truth += [_truth(means, plant.joints[k], multiple, size) for k in ends]
    if case.truth:
        case.kind = "single" if len(case.truth) == 1 else "several"


def _able(means: Means, names: list[str], joints: Any) -> list[int]:
    """Those of the joints at which an effect can be."""
    return [k for k in joints if not means.possible or names[k].endswith(means.possible)]


def _truth(means: Means, joint: str, multiple: float, size: float) -> dict[str, Any]:
    group = [means.effect, *(name for name in means.group if name != means.effect)]
    return {
        "effect": means.effect, "place": means.place, "joint": joint, "multiple": multiple, "size": size,
        "group": group, "number": None,
    }  # fmt: skip


def make(
    out: Path,
    model: Path,
    count: int,
    seed: int,
    key: bytes,
    *,
    jobs: int,
    progress: Callable[[float], None],
    tool: dict[str, Any] | None = None,
) -> str:
    """Write the folder of a trial on this plant; returns the commitment. Arguments: validation/referees/make.make."""
    out.mkdir(parents=True, exist_ok=True)
    nominal, rng = Nominal(model), np.random.default_rng(seed)
    nominal.write(nominal.rows, out / "model.yaml", 100.0, {})
    cases = [
        Case(k, int(rng.integers(2**31)), kind, "development", referee="mujoco")
        for k, kind in enumerate(kinds_in_order(KINDS, count, rng))
    ]
    made = all_made(make_case, [(case, str(model), str(out)) for case in cases], jobs, progress)
    return planned_and_sealed(made, seed, tool, out, key)
