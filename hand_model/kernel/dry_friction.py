"""Dry friction in a step: an impulse that stops a joint or slows it.

Moreau, Unilateral contact and dry friction in finite freedom dynamics, 1988. Two joints with friction that share their
inertia are solved exactly by their four cases.
"""

from __future__ import annotations

from hand_model.kernel.inline import inline


@inline
def soft(x, threshold):  # type: ignore[no-untyped-def]
    """x moved towards 0 by the threshold, and 0 within it."""
    return x - min(max(x, -threshold), threshold)


@inline
def standstill(before, braked):  # type: ignore[no-untyped-def]
    """Share of a step after which a joint stands still for the first time, and 0 where it does not stop.

    braked: speed after the step if friction acted against the speed `before` it all the time [rad/s].
    """
    stops = before * braked < 0.0
    return before / (before - braked if stops else 1.0) if stops else 0.0


@inline
def along(x, direction):  # type: ignore[no-untyped-def]
    """x in a direction."""
    return x if direction > 0.0 else -x


@inline
def _braked(a_0, b_0, y_a, y_b, masses, rub_a, rub_b):  # type: ignore[no-untyped-def]
    """Speeds of a pair [rad/s] after a step in which none stops that moves; one that rests holds where it can."""
    m_a, m_b, m_ab, per_a, per_b, per = masses
    alone_a, alone_b = (y_a - along(rub_a, a_0)) * per_a, (y_b - along(rub_b, b_0)) * per_b
    pull_a, pull_b = y_a - m_ab * alone_b, y_b - m_ab * alone_a
    a_rests, b_rests = a_0 == 0.0, b_0 == 0.0
    left_a = y_a - along(rub_a, pull_a if a_rests else a_0)
    left_b = y_b - along(rub_b, pull_b if b_rests else b_0)
    both_a, both_b = (m_b * left_a - m_ab * left_b) * per, (m_a * left_b - m_ab * left_a) * per
    a_holds, b_holds = a_rests and abs(pull_a) <= rub_a, b_rests and abs(pull_b) <= rub_b
    braked_a = 0.0 if a_holds else (alone_a if b_holds else both_a)
    return braked_a, 0.0 if b_holds else (alone_b if a_holds else both_b)


@inline
def _slowed(y_a, y_b, masses, rub_a, rub_b):  # type: ignore[no-untyped-def]
    """Speeds of a pair [rad/s] after an impulse: each sticks where friction can hold it, else all of that acts."""
    m_a, m_b, m_ab, per_a, per_b, per = masses
    alone_b = soft(y_b, rub_b) * per_b
    push = y_a - m_ab * alone_b
    left_a = y_a - along(rub_a, push)
    alone_a = left_a * per_a
    pull = y_b - m_ab * alone_a
    left_b = y_b - along(rub_b, pull)
    both_a, both_b = (m_b * left_a - m_ab * left_b) * per, (m_a * left_b - m_ab * left_a) * per
    b_sticks = abs(pull) <= rub_b
    a_sticks = abs(push) <= rub_a
    slow_a = 0.0 if a_sticks else (alone_a if b_sticks else both_a)
    return slow_a, alone_b if a_sticks else (0.0 if b_sticks else both_b)


@inline
def rub_pair(a_0, b_0, a, b, m_a, m_b, m_ab, rub_a, rub_b):  # type: ignore[no-untyped-def]
    """Speeds of two coupled joints [rad/s] after a step with dry friction, and what the sums of the speeds at both ends
    of the step have too much for the way of each (OVERRUN).

    a_0, b_0: speeds before the step.  a, b: speeds after it without friction.  m_a, m_b, m_ab: the symmetric matrix of
    the step [kg m^2].  rub_a, rub_b: largest impulses of friction [N m s]. Until the first joint stands still, friction
    acts against the speeds before the step. From then on, what is left of the impulses acts, and the other joint may
    stand still as well. In the end, a joint sticks where an impulse within the bounds stops it, else the whole impulse
    acts against its motion; the four cases are solved exactly.
    """
    masses = m_a, m_b, m_ab, 1.0 / m_a, 1.0 / m_b, 1.0 / (m_a * m_b - m_ab * m_ab)
    y_a, y_b = m_a * a + m_ab * b, m_ab * a + m_b * b
    braked_a, braked_b = _braked(a_0, b_0, y_a, y_b, masses, rub_a, rub_b)
    share_a, share_b = standstill(a_0, braked_a), standstill(b_0, braked_b)
    a_first = share_a > 0.0 and (share_b == 0.0 or share_a <= share_b)
    b_first = share_b > 0.0 and not a_first
    first = share_a if a_first else share_b
    mid_a = 0.0 if a_first else a_0 + first * (braked_a - a_0)
    mid_b = 0.0 if b_first else b_0 + first * (braked_b - b_0)
    left, change_a, change_b = 1.0 - first, mid_a - a_0 - first * (a - a_0), mid_b - b_0 - first * (b - b_0)
    y_a, y_b = y_a + (m_a * change_a + m_ab * change_b), y_b + (m_ab * change_a + m_b * change_b)
    rub_a, rub_b = left * rub_a, left * rub_b
    braked_a, braked_b = _braked(mid_a, mid_b, y_a, y_b, masses, rub_a, rub_b)
    share_a = standstill(mid_a, braked_a) if b_first else 0.0
    share_b = standstill(mid_b, braked_b) if a_first else 0.0
    slow_a, slow_b = _slowed(
        y_a - share_a * along(rub_a, mid_a), y_b - share_b * along(rub_b, mid_b), masses,
        rub_a - share_a * rub_a, rub_b - share_b * rub_b,
    )  # fmt: skip
    stop_a, stop_b = first + left * share_a, first + left * share_b
    over_a = left * a_0 - mid_a * (stop_a if share_a > 0.0 else 1.0) + stop_a * slow_a
    return slow_a, slow_b, over_a, left * b_0 - mid_b * (stop_b if share_b > 0.0 else 1.0) + stop_b * slow_b


@inline
def goes_on_pair(a_0, b_0, a, b, m_a, m_b, m_ab, rub_a, rub_b):  # type: ignore[no-untyped-def]
    """Speeds after a step of two coupled joints of which none stops or starts, and whether that is so: each goes on in
    its direction against the whole friction, or rests and is held. The numbers are those of `rub_pair`.
    """
    per = 1.0 / (m_a * m_b - m_ab * m_ab)
    rests_a, rests_b = a_0 == 0.0, b_0 == 0.0
    y_a, y_b = m_a * a + m_ab * b, m_ab * a + m_b * b
    against_a, against_b = along(rub_a, a_0), along(rub_b, b_0)
    both_a = a - (m_b * against_a - m_ab * against_b) * per
    both_b = b - (m_a * against_b - m_ab * against_a) * per
    alone_a, alone_b = (y_a - against_a) / m_a, (y_b - against_b) / m_b
    slow_a = 0.0 if rests_a else alone_a if rests_b else both_a
    slow_b = 0.0 if rests_b else alone_b if rests_a else both_b
    on_a = abs(y_a - m_ab * slow_b) <= rub_a if rests_a else a_0 * slow_a > 0.0
    on_b = abs(y_b - m_ab * slow_a) <= rub_b if rests_b else b_0 * slow_b > 0.0
    free = rub_a + rub_b == 0.0
    return a if free else slow_a, b if free else slow_b, (on_a and on_b) or free
