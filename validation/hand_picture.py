"""docs/figures/hand.svg: the hand with the names of its joints and the sign of their angles, from config/hand.yaml."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from pathlib import Path

import numpy as np

from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_model.geometry import Link, geometry_of, link_poses
from validation.results import ROOT, STORE

PICTURE = "hand.svg"
BENT_DEG = {"proximal": 40.0, "distal": 50.0}
"""Angles of the finger that is drawn from its side."""
SIDE_FINGER = "index"
HEADING = ("joint, and its range; positive flexes;", "1 turns the thumb before the palm")
MM, LINE_MM, MARGIN_MM, RADIUS_MM = 1e3, 13.0, 8.0, 5.0
STYLE = """
.link{stroke:#dfe4e8;stroke-linecap:round}.edge{stroke:#7a838c;stroke-linecap:round}.palm{fill:#dfe4e8;stroke:#7a838c}
.mark{fill:#0b5f94}.number{fill:#fff;font-weight:bold;text-anchor:middle}text{font:7px sans-serif;fill:#1a1a1a}
.quiet{fill:#555c63}.turn{fill:none;stroke:#b54708;stroke-width:1.2}.head{fill:#b54708}.turned{fill:#b54708}
.zero{stroke:#7a838c;stroke-width:.7;stroke-dasharray:3 2}.paper{fill:#fff}"""


def draw(hand: Hand) -> str:
    """The SVG: the hand from its back, each joint with a number, the list of names, and one bent finger from its side.

    Raises ValueError for a hand without geometry.
    """
    links = list(geometry_of(hand).links)
    straight = link_poses(hand, np.zeros(len(hand.joints)))
    shapes, marks, corners = [], [], []
    for link in links:
        (x1, y1), (x2, y2) = _ends(straight[link.name], link, (1, 0))
        width = MM * link.size_m[1]
        corners += [(x + side * width / 2, y) for x, y in ((x1, y1), (x2, y2 - width / 2)) for side in (-1, 1)]
        if link.joint < 0:
            box = f'x="{x1 - width / 2:.1f}" y="{y2:.1f}" width="{width:.1f}" height="{y1 - y2:.1f}"'
            shapes.append(f'<rect class="palm" {box} rx="12"/>')
            continue
        shapes.append(_bar((x1, y1), (x2, y2), width))
        marks.append(_mark(x1, y1, link.joint + 1))
    left, top = (min(corner[k] for corner in corners) - MARGIN_MM for k in (0, 1))
    beside = max(corner[0] for corner in corners) + 3 * MARGIN_MM
    legend = list(_legend(hand, beside, top + LINE_MM))
    below = top + LINE_MM * (len(legend) + 1)
    side, bottom = _bent(hand, links, beside, below)
    width, height = beside + 190.0 - left, max(bottom, *(c[1] for c in corners)) + MARGIN_MM - top
    box = f"{left:.1f} {top:.1f} {width:.1f} {height:.1f}"
    body = "\n".join([*shapes, *marks, *legend, *side])
    paper = f'<rect class="paper" x="{left:.1f}" y="{top:.1f}" width="{width:.1f}" height="{height:.1f}"/>'
    alt = f"The hand from its back with the numbers and names of its {len(hand.joints)} joints; positive angles flex"
    size = f'viewBox="{box}" width="{2.4 * width:.0f}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img" aria-label="{alt}">'
    return f"{head}\n<style>{STYLE}</style>\n{paper}\n{body}\n</svg>\n"


def _ends(pose: Array, link: Link, axes: tuple[int, int]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Both ends of a link on the picture [mm]; axes: of the palm that point to the left and up."""
    points = (pose @ np.array([length, 0.0, 0.0, 1.0]) for length in (0.0, link.size_m[0]))
    first, second = ((-MM * float(p[axes[0]]), -MM * float(p[axes[1]])) for p in points)
    return first, second


def _bar(start: tuple[float, float], end: tuple[float, float], width: float) -> str:
    line = f'x1="{start[0]:.1f}" y1="{start[1]:.1f}" x2="{end[0]:.1f}" y2="{end[1]:.1f}"'
    edge = f'<line class="edge" {line} stroke-width="{width:.1f}"/>'
    return f'{edge}<line class="link" {line} stroke-width="{width - 1.6:.1f}"/>'


def _mark(x: float, y: float, number: int) -> str:
    circle = f'<circle class="mark" cx="{x:.1f}" cy="{y:.1f}" r="{RADIUS_MM}"/>'
    return f'{circle}<text class="number" x="{x:.1f}" y="{y + 2.4:.1f}">{number}</text>'


def _legend(hand: Hand, x: float, y: float) -> Iterator[str]:
    """A line for each joint: number, name, and its range with signs."""
    first = y + LINE_MM * (len(HEADING) - 1)
    for k, line in enumerate(HEADING):
        yield f'<text class="quiet" x="{x:.1f}" y="{y + 0.8 * LINE_MM * k:.1f}">{line}</text>'
    low, high = np.degrees(hand.limits.low_rad), np.degrees(hand.limits.high_rad)
    for k, joint in enumerate(hand.joints):
        at = first + LINE_MM * (k + 1)
        yield _mark(x + RADIUS_MM, at - 2.4, k + 1) + (
            f'<text x="{x + 3 * RADIUS_MM:.1f}" y="{at:.1f}">{escape(joint)}</text>'
            f'<text class="quiet" x="{x + 100:.1f}" y="{at:.1f}">{low[k]:+.0f} … {high[k]:+.0f} deg</text>'
        )


def _bent(hand: Hand, links: list[Link], x: float, y: float) -> tuple[list[str], float]:
    """One finger from its side, bent, with the turn of each joint; and the lowest point [mm]."""
    names = {joint: hand.joints[k] for k, joint in enumerate(hand.joints)}
    own = [link for link in links if link.joint >= 0 and f"{SIDE_FINGER}_" in names[hand.joints[link.joint]]]
    angles = np.zeros(len(hand.joints))
    for link in own:
        angles[link.joint] = np.radians(BENT_DEG[hand.joints[link.joint].rpartition("_")[2]])
    poses = link_poses(hand, angles)
    origin = poses[own[0].name][:, 3]
    shapes, over, lowest, heading = [], [], y, 0.0
    for link in own:
        pose = poses[link.name]
        start, end = (
            _from_side(pose @ np.array([s, 0.0, 0.0, 1.0]) - origin, x + 25.0, y + 22.0) for s in (0.0, link.size_m[0])
        )
        bend = float(np.degrees(angles[link.joint]))
        shapes.append(_bar(start, end, MM * link.size_m[2]))
        over += [_turn(start, heading, heading + bend, bend), _mark(*start, link.joint + 1)]
        heading += bend
        lowest = max(lowest, start[1], end[1])
    said = f"{SIDE_FINGER} from the side: palm below, dashed: angle 0"
    title = f'<text class="quiet" x="{x:.1f}" y="{y + 6:.1f}">{said}</text>'
    return [title, *shapes, *over], lowest + MARGIN_MM


def _from_side(point: Array, x: float, y: float) -> tuple[float, float]:
    """A point of the palm's frame [m] on the picture: fingertips to the right, the back up."""
    return x + MM * float(point[0]), y - MM * float(point[2])


def _turn(at: tuple[float, float], before_deg: float, after_deg: float, bend_deg: float) -> str:
    """The zero direction of a joint, and an arrow from there to its angle."""
    radius = 24.0

    def around(angle_deg: float, length: float) -> tuple[float, float]:
        angle = np.radians(angle_deg)
        return at[0] + length * float(np.cos(angle)), at[1] + length * float(np.sin(angle))

    (x0, y0), (x1, y1), far = around(before_deg, radius), around(after_deg, radius), around(before_deg, 1.5 * radius)
    tip = [around(after_deg, radius + side) for side in (3.0, -3.0)]
    ahead = around(after_deg + 9.0, radius)
    head = " ".join(f"{px:.1f},{py:.1f}" for px, py in (*tip, ahead))
    text = around(before_deg + 0.5 * bend_deg, radius + 9.0)  # off the arc and the dashed line
    return (
        f'<line class="zero" x1="{at[0]:.1f}" y1="{at[1]:.1f}" x2="{far[0]:.1f}" y2="{far[1]:.1f}"/>'
        f'<path class="turn" d="M{x0:.1f} {y0:.1f}A{radius} {radius} 0 0 1 {x1:.1f} {y1:.1f}"/>'
        f'<polygon class="head" points="{head}"/>'
        f'<text class="turned" x="{text[0]:.1f}" y="{text[1]:.1f}">+{bend_deg:.0f}°</text>'
    )


def write(out: Path = STORE.parent / PICTURE) -> None:
    """Write the picture of the shipped hand. Raises OSError where it cannot be written."""
    out.write_text(draw(load_hand(ROOT / "config" / "hand.yaml")), encoding="utf-8")
