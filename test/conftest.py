"""All tests: compiled kernels belong to the very sources under test."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
_SOURCES = sorted(ROOT.glob("hand_*/*.py"))
_STAMP = hashlib.sha256(b"".join(path.read_bytes() for path in _SOURCES)).hexdigest()[:16]
# Numba's cache looks at changes of one file alone; a kernel that takes an equation from another could be stale.
# Set before numba is imported, and inherited by every process that a test starts.
os.environ["NUMBA_CACHE_DIR"] = str(ROOT / ".pytest_cache" / f"kernels-{_STAMP}")
