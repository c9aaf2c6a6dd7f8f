from setuptools import setup

EXECUTABLES = ("closed_loop_evaluation", "vehicle_node")

setup(
    name="lfd_vehicle",
    version="0.1.0",
    packages=["lfd_vehicle"],
    package_data={"lfd_vehicle": ["*.html"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/lfd_vehicle"]),
        ("share/lfd_vehicle", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The lfd developers",
    maintainer_email="lfd@example.com",
    description=(
        "The closed loop: a full vehicle model behind a lead, its sensors, "
        "and what becomes of a fault."
    ),
    license="Apache-2.0",
    entry_points={
        "console_scripts": [f"{name} = lfd_vehicle.executables:{name}" for name in EXECUTABLES]
    },
)
