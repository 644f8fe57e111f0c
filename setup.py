from pathlib import Path

from setuptools import setup

NAME = "fluidic_hand"
PACKAGES = [
    "hand_model",
    "hand_model.effects",
    "hand_messages",
    "hand_model.kernel",
    "hand_ros",
    "hand_driver",
    "hand_control",
    "hand_sim",
    "hand_recording",
    "hand_identification",
    "hand_diagnosis",
    "hand_tool",
    "validation",
    "validation.bench",
    "validation.magnet",
    "validation.paper",
    "validation.trial",
]


def files(folder: str, pattern: str) -> list[str]:
    return sorted(str(path) for path in Path(folder).glob(pattern))


setup(
    name=NAME,
    version="0.1.0",
    packages=PACKAGES,
    package_data={package: ["*.dbc", "*.html", "*.json", "*.txt"] for package in PACKAGES},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", files("config", "*.yaml")),
        (f"share/{NAME}/launch", files("launch", "*.launch.py")),
        ("bin", ["tools/hand"]),
    ],
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},
    zip_safe=False,
    maintainer="fluidic_hand maintainers",
    maintainer_email="maintainers@fluidic-hand.invalid",
    description="Driver, simulation, controller and recorder of a robot hand with eleven flexible fluidic actuators.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "driver = hand_driver.node:main",
            "simulation = hand_sim.node:main",
            "controller = hand_control.node:main",
            "recorder = hand_recording.node:main",
            "hand = hand_tool.cli:main",
        ]
    },
)
