"""Where a recording and the model differ: located, named, modelled, shown.

`diagnose`, `read_recording` and `Report` are the stable Python interface (api.py); they are imported on first use,
because the fits behind them take a second to load.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hand_diagnosis.api import Report, diagnose, read_recording

__all__ = ["Report", "diagnose", "read_recording"]


def __getattr__(name: str) -> Any:
    """Import the interface on first use (PEP 562)."""
    if name in __all__:
        from hand_diagnosis import api  # noqa: PLC0415 - see above

        return getattr(api, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
