"""Diagnose a recording from Python: python examples/diagnose.py [OUT]

The same as: hand diagnose examples/recordings/index_concealed.csv --map examples/recordings/map.yaml
--joints index_distal --out out/example
"""

from __future__ import annotations

import sys
from pathlib import Path

from hand_diagnosis import Report, diagnose, read_recording

HERE = Path(__file__).resolve().parent
MODEL = HERE.parent / "config" / "hand.yaml"


def main(out: Path) -> Report:
    """Read, diagnose, print the answer, and write report.json, report.html and model.yaml."""
    samples = HERE / "recordings"
    recording = read_recording(samples / "index_concealed.csv", MODEL, mapping=samples / "map.yaml")
    report = diagnose([recording], MODEL, joints=["index_distal"])
    print(report.verdict)
    for finding in report.findings:
        print(f"{finding['probability']:.0%} {finding['effect']}: {finding['statement']}")
        for name, number in finding["parameters"].items():
            print(f"  {name} = {number['value']:.3g} ± {number['std']:.1g} {number['unit']}")
    report.write(out)
    return report


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("out") / "example")
