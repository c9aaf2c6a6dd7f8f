from setuptools import setup

EXECUTABLES = (
    "bag_player",
    "calibrate",
    "check_requirements",
    "evaluate",
    "fault_injector",
    "host_adapter",
    "import_drive",
    "inspect",
    "make_drive",
    "paper_evaluation",
    "radar_adapter",
)

setup(
    name="lfd_replay",
    version="0.1.0",
    packages=[
        "lfd_replay",
        "lfd_replay.drawing",
        "lfd_replay.evaluation",
        "lfd_replay.evaluation.requirements",
        "lfd_replay.generated",
        "lfd_replay.recordings",
    ],
    package_data={"lfd_replay.recordings": ["dbc/*.dbc"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/lfd_replay"]),
        ("share/lfd_replay", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The lfd developers",
    maintainer_email="lfd@example.com",
    description=(
        "Drives in and out: bag player, importers, fault injection, generated drives, "
        "offline evaluation and reports."
    ),
    license="Apache-2.0",
    entry_points={
        "console_scripts": [f"{name} = lfd_replay.executables:{name}" for name in EXECUTABLES]
    },
)
