"""Diagnose recordings of the plants of the bench `found`, and store the patches that the diagnoses write.

python -m validation.bench.found_models [NAME...]; each diagnosis takes minutes.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from hand_diagnosis.api import diagnose
from hand_diagnosis.patch import PATCH
from hand_model.description import load_hand
from validation.bench.bench_found import HIDDEN, JOINT, MODELS, plant_of, record

TOLERANCE = 0.05
"""Relative standard deviation of the nominal numbers that a diagnosis assumes; they are exact here."""


def main() -> int:
    """Write one patch of config/hand.yaml for each effect; exit code 0."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.bench.found_models",
        description=(__doc__ or "").splitlines()[0],
        epilog="Example: python -m validation.bench.found_models friction leak",
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(HIDDEN)}; all where none is given")
    names = parser.parse_args().names or list(HIDDEN)
    if unknown := [name for name in names if name not in HIDDEN]:
        parser.error(f"the name is {unknown[0]!r}; it must be one of {', '.join(HIDDEN)}")
    hand = load_hand(Path("config/hand.yaml"))
    MODELS.mkdir(exist_ok=True)
    for name in names:
        report = diagnose(
            [record(hand, plant_of(hand, name))], hand, tolerance=TOLERANCE, joints=(JOINT,), sensor_curve=False
        )
        with tempfile.TemporaryDirectory() as folder:
            report.write(folder, page=False)
            patch = (Path(folder) / PATCH).read_text(encoding="utf-8").replace(f"{folder}/", "")
        (MODELS / f"{name.replace(' ', '_')}.yaml").write_text(patch, encoding="utf-8")
        found = ", ".join(f"{each['effect']} {each['probability']:.2f}" for each in report.findings)
        print(f"{name}: {report.verdict}, {found or 'nothing named'}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
