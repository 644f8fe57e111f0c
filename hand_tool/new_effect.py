"""`hand new-effect`: files of a new effect of the catalogue, to be filled in as docs/effects.md describes."""

from __future__ import annotations

import keyword
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from hand_tool.console import running
from hand_tool.effect_draft import drafted
from hand_tool.options import Quiet, Verbose

_ORDER = re.compile(r'^ORDER: tuple\[str, \.\.\.\] = \(\n((?:    "\w+",\n)*)\)$', re.MULTILINE)
_CHECKS_END = "# Wrong numbers of the plain plant: on one joint of it.\n"
_CHECK = '''def {name}(_: Any) -> None:
    """Broken by a wrong sign, factor or memory of the equation of `{name}`."""
    pytest.fail("compare the equation of {name} with a closed form, a limit case or an energy balance")


'''
PLACES = (
    "supply", "valve", "fluid", "material", "joint", "environment", "angle_sensor", "pressure_sensor", "force_sensor",
    "timing",
)  # fmt: skip
"""The places of hand_model.effects.effect, which compiles when it is imported; a test compares them."""
_NEXT = """Next, as docs/effects.md describes:
1. Write equation, parameters and texts in {effect}
2. Write its check in {test}, in the function {name}
3. Run: python -m pytest test/model/test_effects.py test/model/test_effect_catalogue.py
4. Run: python -m hand_model.tables"""


def new_effect(
    name: Annotated[str, typer.Argument(help="Name of the effect: lower case, words joined by underscores.")],
    *,
    place: Annotated[str, typer.Option(help=f"Where it acts: {', '.join(PLACES)}.")] = "joint",
    after: Annotated[str, typer.Option(help="Effect of the catalogue that it follows. Default: the last one.")] = "",
    source: Annotated[
        Path | None, typer.Option("--from", help="report.json: draft the effect from the law of a remainder.")
    ] = None,
    joint: Annotated[str, typer.Option(help="Joint of that remainder. Default: the first one with a law.")] = "",
    tree: Annotated[Path, typer.Option(help="Source tree to write to.")] = Path(),
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Write the file of a new effect and a stub of its test, and enter it in the catalogue.

    Example: hand new-effect tendon_friction --place joint

    Example: hand new-effect gear_ripple --from out/diagnosis/report.json

    Exit codes: 0 done, 2 bad usage or bad input.
    """
    with running("new-effect"):
        effect, test = write_effect(tree, name, place, after, drafted(source, joint) if source else None)
    print(_NEXT.format(effect=effect, test=test, name=name))


def write_effect(
    tree: Path, name: str, place: str, after: str = "", draft: Mapping[str, str] | None = None
) -> tuple[Path, Path]:
    """Write hand_model/effects/NAME.py, its place in ORDER and its check; returns the effect's file and the test's.

    draft: fields of the template of a law (effect_draft.drafted), whose place is used; None for the other template.
    Raises ValueError, one line, for a name, a place or a tree that does not fit; nothing is written then.
    """
    folder, test = tree / "hand_model" / "effects", tree / "test" / "model" / "test_effects.py"
    for path in (folder / "__init__.py", folder / "template.py.txt", folder / "template_law.py.txt", test):
        if not path.is_file():
            raise ValueError(f"{path} is not there; --tree must be the source tree, not an installed copy")
    if not re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", name) or keyword.iskeyword(name):
        raise ValueError(f"name is '{name}'; allowed are lower case letters, digits and single underscores")
    if place not in PLACES:
        raise ValueError(f"--place is '{place}'; it must be one of {', '.join(PLACES)}")
    checks = test.read_text(encoding="utf-8")
    if checks.count(_CHECKS_END) != 1:
        raise ValueError(f"{test} has no line '{_CHECKS_END.strip()}', above which the check would stand")
    catalogue = _entered((folder / "__init__.py").read_text(encoding="utf-8"), name, after)
    effect = folder / f"{name}.py"
    if effect.exists() or re.search(rf"^def {name}\(", checks, re.MULTILINE):
        raise ValueError(f"name is '{name}'; {effect.name} or a function of this name in {test.name} is there already")
    template = "template.py.txt" if draft is None else "template_law.py.txt"
    text = (folder / template).read_text(encoding="utf-8")
    for field, value in {"PLACE": place, **(draft or {}), "NAME": name}.items():
        text = text.replace(f"@{field}@", value)
    effect.write_text(text, encoding="utf-8")
    test.write_text(checks.replace(_CHECKS_END, _CHECK.format(name=name) + _CHECKS_END), encoding="utf-8")
    (folder / "__init__.py").write_text(catalogue, encoding="utf-8")
    return effect, test


def _entered(source: str, name: str, after: str) -> str:
    """The source of the catalogue with a name entered in ORDER."""
    match = _ORDER.search(source)
    names = re.findall(r'"(\w+)"', match[1]) if match else []
    if match is None or not names:
        raise ValueError("hand_model/effects/__init__.py has no tuple ORDER of one name per line")
    if name in names:
        raise ValueError(f"name is '{name}'; the catalogue has this effect already")
    if after and after not in names:
        raise ValueError(f"--after is '{after}'; it must be one of {', '.join(names)}")
    names.insert(names.index(after) + 1 if after else len(names), name)
    entries = "".join(f'    "{entry}",\n' for entry in names)
    return source[: match.start(1)] + entries + source[match.end(1) :]
