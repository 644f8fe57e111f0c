"""The hand from its back as SVG, its links tinted by how far the nominal model misses each joint."""

from __future__ import annotations

import math
from collections.abc import Mapping
from html import escape

import numpy as np

from hand_diagnosis.settings import SETTINGS
from hand_model.description import Hand
from hand_model.geometry import geometry_of, link_poses


def tint(ratio: float) -> float:
    """Opacity of the tint, 0 to SETTINGS.strongest_tint, of an error; logarithmic from 1 to full_tint.

    ratio: the error in multiples of the noise [-].
    """
    if not ratio > 1.0:
        return 0.0
    return SETTINGS.strongest_tint * min(math.log(ratio) / math.log(SETTINGS.full_tint), 1.0)


def hand_drawing(hand: Hand, ratios: Mapping[str, float | None], links: Mapping[str, str]) -> str:
    """The SVG. ratios: error in multiples of the noise by joint; None: not diagnosed.  links: address by joint.

    The hand is seen from its back with straight fingers, so a right thumb is on the left. ValueError without geometry.
    """
    geometry = geometry_of(hand)
    poses = link_poses(hand, np.zeros(len(hand.joints)))
    shapes, points = [], []
    for link in geometry.links:
        start = poses[link.name] @ np.array([0.0, 0.0, 0.0, 1.0])
        end = poses[link.name] @ np.array([link.size_m[0], 0.0, 0.0, 1.0])
        (x1, y1), (x2, y2) = ((-1e3 * point[1], -1e3 * point[0]) for point in (start, end))
        width = 1e3 * link.size_m[1]
        points += [(x + side * width / 2, y) for x, y in ((x1, y1), (x2, y2)) for side in (-1, 1)]
        if link.joint < 0:
            box = f'x="{x1 - width / 2:.1f}" y="{y2:.1f}" width="{width:.1f}" height="{y1 - y2:.1f}" rx="12"'
            shapes.append(f'<rect class="palm" {box}/>')
            continue
        joint = hand.joints[link.joint]
        line = f'x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"'
        shapes.append(_joint(joint, line, width, ratios.get(joint), links.get(joint)))
    left, top = (min(point[k] for point in points) - SETTINGS.drawing_margin_mm for k in (0, 1))
    right, bottom = (max(point[k] for point in points) + SETTINGS.drawing_margin_mm for k in (0, 1))
    box = f"{left:.1f} {top:.1f} {right - left:.1f} {bottom - top:.1f}"
    return f'<svg viewBox="{box}" role="img" aria-label="{escape(_alt(ratios))}">{"".join(shapes)}</svg>'


def _joint(joint: str, line: str, width: float, ratio: float | None, link: str | None) -> str:
    title = f"{joint}: not diagnosed" if ratio is None else f"{joint}: error {ratio:.3g} times the noise"
    outline = f'<line class="outline" {line} stroke-width="{width:.1f}"/>'
    inside = f'<line class="skin" {line} stroke-width="{width - 2.0:.1f}"/>'
    kind = ' class="unknown"' if ratio is None else ""
    opacity = SETTINGS.unjudged_tint if ratio is None else tint(ratio)
    colour = f'<line{kind} {line} stroke-width="{width - 2.0:.1f}" stroke-opacity="{opacity:.2f}"/>'
    drawn = f"<g><title>{escape(title)}</title>{outline}{inside}{colour}</g>"
    return f'<a href="{escape(link)}" aria-label="{escape(title)}">{drawn}</a>' if link else drawn


def _alt(ratios: Mapping[str, float | None]) -> str:
    """What the tint shows."""
    known = {joint: ratio for joint, ratio in ratios.items() if ratio is not None}
    if not known:
        return "The hand; no joint was diagnosed"
    worst = max(known, key=lambda joint: known[joint])
    return f"The hand; the nominal model misses {worst} most, by {known[worst]:.3g} times the noise"
