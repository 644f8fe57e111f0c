"""The part `geometry` of the description: links, masses, axes and frames, written for a right hand."""

from __future__ import annotations

from typing import Literal

import numpy as np

from hand_model.arrays import Array
from hand_model.geometry import PALM, Frame, Geometry, Link, Shape, link_name, pose, rotation_about, rotation_from_rpy
from hand_model.yaml_reader import Section

GEOMETRY = ("side", "palm", "links")
_BODY = ("length_m", "width_m", "thickness_m", "mass_kg")
_LINK = ("joint", "parent", "origin_m", "rpy_deg", "axis", "tip_frame", *_BODY)
_MIRROR = np.diag([1.0, -1.0, 1.0])
# The z axis of a force site points out of the pad, that of its link to the back.
_OUT_OF_PAD = rotation_about(np.array([1.0, 0.0, 0.0]), np.pi)


def read_geometry(top: Section, names: list[str], prefix: str, sites: list[Section]) -> Geometry | None:
    """The geometry; None where the file has none, as in descriptions of version 0.2.0 and before.

    names: of the joints without the prefix.  sites: the force sites, whose pads lie on the links.
    Raises DescriptionError, one line, for a joint without a link, a loop, or a value out of its range.
    """
    if "geometry" not in top:
        return None
    section = top.section("geometry", GEOMETRY)
    usual = "left" if "left" in prefix.split("_") else "right"
    side: Literal["right", "left"] = "left" if section.choice("side", ["right", "left"], usual) == "left" else "right"
    links = [_palm(section.section("palm", _BODY), prefix)]
    frames = []
    for entry in section.sections("links", _LINK):
        link = _link(entry, names, prefix, links)
        links.append(link)
        tip = entry.name("tip_frame", "")
        if tip:
            tip_pose = pose(np.array([link.size_m[0], 0.0, 0.0]))
            frames.append(Frame(prefix + tip, link.name, "fingertip", tip_pose))
    missing = set(range(len(names))) - {link.joint for link in links}
    if missing:
        raise section.error("links", f"has no link for {names[min(missing)]}; every joint must have one")
    frames += [_pad(site, names, prefix, links) for site in sites]
    _check_names(section, [link.name for link in links] + [frame.name for frame in frames])
    return _mirrored(links, frames) if side == "left" else Geometry(side, tuple(links), tuple(frames))


def _check_names(section: Section, names: list[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise section.error("links", f"has the frame {name} twice; each name of a link or frame must be there once")


def _body(section: Section) -> tuple[tuple[float, float, float], float, Array]:
    """Length, width, thickness [m], mass [kg] and moments of inertia of a box of even density [kg m^2]."""
    size = (
        section.number("length_m", 1e-3, 0.5),
        section.number("width_m", 1e-3, 0.3),
        section.number("thickness_m", 1e-3, 0.2),
    )
    mass = section.number("mass_kg", 1e-4, 5.0)
    square = np.square(size)
    return size, mass, mass / 12.0 * (square.sum() - square)


def _palm(section: Section, prefix: str) -> Link:
    size, mass, inertia = _body(section)
    center = np.array([size[0] / 2.0, 0.0, 0.0])
    shape = Shape("box", size, pose(center))
    return Link(
        name=prefix + PALM,
        parent="",
        joint=-1,
        origin=np.eye(4),
        axis=np.zeros(3),
        size_m=size,
        mass_kg=mass,
        center_m=center,
        inertia_kg_m2=inertia,
        shapes=(shape,),
    )


def _link(entry: Section, names: list[str], prefix: str, above: list[Link]) -> Link:
    joint = entry.choice("joint", names)
    index = names.index(joint)
    if index in {link.joint for link in above}:
        raise entry.error("joint", f"is '{joint}', which moves another link already")
    earlier = {link.name: link for link in above}
    # In the file a parent is named by the joint that moves it.
    parents = {PALM: above[0], **{name: earlier[n] for name in names if (n := link_name(prefix + name)) in earlier}}
    parent = parents[entry.choice("parent", list(parents))]
    size, mass, inertia = _body(entry)
    axis = np.array(entry.numbers("axis", 3, [0.0, 1.0, 0.0]))
    norm = float(np.linalg.norm(axis))
    if not 1e-3 <= norm <= 1e3:
        raise entry.error("axis", f"has the length {norm:g}; it must be a vector of a length from 0.001 to 1000")
    origin = np.array(entry.numbers("origin_m", 3, [parent.size_m[0], 0.0, 0.0]))
    if np.abs(origin).max() > 1.0:
        raise entry.error("origin_m", f"is {origin.tolist()}; each number must be from -1 to 1")
    rotation = rotation_from_rpy(np.radians(entry.numbers("rpy_deg", 3, [0.0, 0.0, 0.0])))
    return Link(
        name=link_name(prefix + joint),
        parent=parent.name,
        joint=index,
        origin=pose(origin, rotation),
        axis=axis / norm,
        size_m=size,
        mass_kg=mass,
        center_m=np.array([size[0] / 2.0, 0.0, 0.0]),
        inertia_kg_m2=inertia,
        shapes=(_phalanx(size, ends_in_tip="tip_frame" in entry),),
    )


def _phalanx(size_m: tuple[float, float, float], *, ends_in_tip: bool) -> Shape:
    """A capsule from the joint to the end of the link; at a fingertip its round end is inside the length."""
    length, width, thickness = size_m
    radius = (width + thickness) / 4.0
    straight = max(length - radius if ends_in_tip else length, 1e-4)
    return Shape("capsule", (straight, radius), pose(np.array([straight / 2.0, 0.0, 0.0])))


def _pad(site: Section, names: list[str], prefix: str, links: list[Link]) -> Frame:
    """The frame of a force site: on the flexing side of the link, at the lever arm from the joint."""
    joint = site.choice("joint", names, "")
    link = next(link for link in links if link.joint == (names.index(joint) if joint else -1))
    along = site.number("lever_arm_m", 1e-3, 0.5) if joint else link.size_m[0] / 2.0
    place = site.numbers("position_m", 3, [along, 0.0, -link.size_m[2] / 2.0])
    return Frame(prefix + site.name("name"), link.name, "force_site", pose(np.array(place), _OUT_OF_PAD))


def _mirrored(links: list[Link], frames: list[Frame]) -> Geometry:
    """The left hand: the right one, reflected in the plane of x and z. An axis of rotation is a pseudovector."""
    mirrored = tuple(
        Link(
            name=link.name,
            parent=link.parent,
            joint=link.joint,
            origin=_reflected(link.origin),
            axis=-_MIRROR @ link.axis,
            size_m=link.size_m,
            mass_kg=link.mass_kg,
            center_m=_MIRROR @ link.center_m,
            inertia_kg_m2=link.inertia_kg_m2,
            shapes=tuple(Shape(shape.kind, shape.size_m, _reflected(shape.pose)) for shape in link.shapes),
        )
        for link in links
    )
    turned = tuple(Frame(frame.name, frame.link, frame.kind, _reflected(frame.pose)) for frame in frames)
    return Geometry("left", mirrored, turned)


def _reflected(matrix: Array) -> Array:
    """A pose, reflected; it stays a rotation because both its axes and the space are reflected."""
    return pose(_MIRROR @ matrix[:3, 3], _MIRROR @ matrix[:3, :3] @ _MIRROR)
