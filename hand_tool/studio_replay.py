"""`hand studio RECORDING`: a recording in the browser, next to models of the hand."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from hand_tool import interrupts
from hand_tool.paths import check_exists, check_file

if TYPE_CHECKING:
    from hand_model.description import Hand
    from hand_studio.page import Page

MODEL = "model.yaml"
"""What `hand diagnose` writes into its folder."""
DEFAULT = "hand"
"""Namespace that stands for the only one of a recording."""


def replay(
    recorded: tuple[Path, str],
    after: Path | None,
    hand: Hand,
    serve: Callable[[], Page],
    announce: Callable[[Page, str], None],
) -> None:
    """Serve the page until Ctrl-C.

    recorded: the recording, and the namespace of the hand in it where there are several.  after: the found model.
    serve: makes the page.  announce: called with the page and its name.
    Raises ValueError, one line, for a recording or a model that cannot be used.
    """
    recording, namespace = recorded
    check_exists(recording)
    from hand_model.description import load_hand
    from hand_recording.hand_signals import hand_signals
    from hand_recording.loader import load_recording
    from hand_studio.replay import Replay, window_of
    from hand_studio.replay_page import ReplayPage

    found = None
    if after is not None:
        path = check_file(after / MODEL if after.is_dir() else after)
        found = load_hand(path, hand.prefix)
        if found.joints != hand.joints:
            raise ValueError(f"{path} has the joints {', '.join(found.joints)}; those of {hand.path} are expected")
    shown = Replay(
        hand,
        window_of(hand_signals(load_recording(recording, None if namespace == DEFAULT else namespace), hand), hand),
    )
    before = shown.run(hand.parameters)
    page = serve()
    try:
        view = ReplayPage(page, recording.name, shown, before, before if found is None else shown.run(found.parameters))
        announce(page, str(recording))
        interrupts.release()
        view.run(interrupts.check)
    except interrupts.Interrupted:
        return
    finally:
        page.close()
