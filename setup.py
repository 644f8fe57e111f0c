"""The package for pip and for colcon (ament_python).

The version, the maintainer and the licence are written in package.xml, the requirements in requirements*.txt; both are
read here. `hand` is the only console script. The nodes are data files below lib/fluidic_hand, where `ros2 run` and
launch files look for executables, and where neither pip nor colcon puts them on PATH.
"""

import os
import re
import xml.etree.ElementTree as ET
from pathlib import Path

from setuptools import setup

NAME = "fluidic_hand"
PACKAGES = [
    "hand_model",
    "hand_model.effects",
    "hand_messages",
    "hand_pages",
    "hand_model.kernel",
    "hand_ros",
    "hand_client",
    "hand_driver",
    "hand_control",
    "hand_robot",
    "hand_sim",
    "hand_recording",
    "hand_machine",
    "hand_identification",
    "hand_diagnosis",
    "hand_diagnosis.diagnosis",
    "hand_diagnosis.judgement",
    "hand_diagnosis.pages",
    "hand_diagnosis.problem",
    "hand_diagnosis.search",
    "hand_studio",
    "hand_tool",
    "validation",
    "validation.bench",
    "validation.faults",
    "validation.machines",
    "validation.magnet",
    "validation.mutation",
    "validation.paper",
    "validation.referees",
    "validation.trial",
]
WITHOUT = "HAND_WITHOUT_VALIDATION"
"""Environment variable: set to 1, the build leaves out `validation`, which no robot needs."""
if os.environ.get(WITHOUT) == "1":
    PACKAGES = [package for package in PACKAGES if package.split(".")[0] != "validation"]
ROOT = Path(__file__).resolve().parent
EXTRAS = ("ros", "analysis", "studio", "validation", "dev")


def files(folder: str, pattern: str) -> list[str]:
    return sorted(str(path.relative_to(ROOT)) for path in (ROOT / folder).glob(pattern))


def requirements(name: str, *, pinned: bool = False) -> list[str]:
    """The requirements of a file without those marked as tools, which are run and never imported.

    Without their versions: the files pin what was tested together, and other versions may do as well.
    """
    lines = (ROOT / name).read_text(encoding="utf-8").splitlines()
    wanted = [line.strip() for line in lines if line.strip() and "#" not in line]
    return wanted if pinned else [re.split(r"[=<>~!]", line)[0] for line in wanted]


manifest = ET.parse(ROOT / "package.xml").getroot()
maintainer = manifest.find("maintainer")
if maintainer is None:
    raise SystemExit("package.xml names no maintainer")

setup(
    name=NAME,
    version=manifest.findtext("version"),
    description=manifest.findtext("description"),
    license=manifest.findtext("license"),
    url=manifest.findtext("url"),
    maintainer=maintainer.text,
    maintainer_email=maintainer.get("email"),
    python_requires=">=3.11",
    packages=PACKAGES,
    package_data={
        package: [
            "py.typed",
            "*.dbc",
            "*.html",
            "*.css",
            "*.js",
            "*.json",
            "*.txt",
            "*.yaml",
            "*.toml",
            "*.c",
            "*.h",
            "rows/*.yaml",
            "*/machine.yaml",
            "*/published.yaml",
        ]
        for package in PACKAGES
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", [*files("config", "*.yaml"), *files("config", "*.xml")]),
        (f"share/{NAME}/config/security", files("config/security", "*.xml")),
        (f"share/{NAME}/urdf", files("urdf", "*.xacro")),
        (f"share/{NAME}/config/layouts", files("config/layouts", "*")),
        (f"share/{NAME}/launch", files("launch", "*.launch.py")),
        # Recordings hold the definitions of their messages; without ROS they are read here.
        (f"share/{NAME}/interfaces/hand_msgs/msg", files("hand_msgs/msg", "*.msg")),
        (f"lib/{NAME}", files("tools/nodes", "*")),
    ],
    install_requires=requirements("requirements.txt"),
    extras_require={
        # Unpinned, the names of the ROS wheels would resolve to a later distribution than Jazzy.
        **{name: requirements(f"requirements-{name}.txt", pinned=name == "ros") for name in EXTRAS},
        # colcon runs pytest for a package that asks for it here.
        "test": ["pytest"],
    },
    zip_safe=False,
    entry_points={"console_scripts": ["hand = hand_tool.main:main"]},
)
