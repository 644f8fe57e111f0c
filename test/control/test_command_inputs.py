"""Bounds on how many commands and contact forces a second are read."""

from __future__ import annotations

import pytest

from hand_control.command_inputs import BURST, FORCES_HZ, CommandInputs
from hand_messages.bounds import COMMAND_BURST


@pytest.mark.parametrize("rate_hz", [200.0, 1000.0])
def test_contact_forces_have_a_bound_of_their_own(rate_hz: float) -> None:
    """Fails when forces of a fast board are dropped, more than FORCES_HZ are read, or other topics pay for them."""
    inputs = CommandInputs(11)
    assert all(inputs.take("contact_forces", k / rate_hz) for k in range(round(5.0 * rate_hz)))
    assert not inputs.problem(5.0)
    read = sum(inputs.take("contact_forces", 10.0 + k / 5000.0) for k in range(10_000))
    assert 2.0 * FORCES_HZ - 1 <= read <= 2.0 * FORCES_HZ + COMMAND_BURST
    assert "contact_forces: more than 2000 messages a second" in inputs.problem(12.0)
    assert sum(inputs.take("grasp", 12.0) for _ in range(1000)) == BURST
