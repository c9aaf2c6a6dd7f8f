from glob import glob

from setuptools import setup

EXECUTABLES = ("compile_all", "replay", "simulate")

setup(
    name="lfd_bringup",
    version="0.1.0",
    packages=["lfd_bringup"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/lfd_bringup"]),
        ("share/lfd_bringup", ["package.xml"]),
        ("share/lfd_bringup/config", glob("config/*")),
        ("share/lfd_bringup/layouts", glob("layouts/*")),
        ("share/lfd_bringup/launch", glob("launch/*.launch.py")),
        ("share/lfd_bringup/params", glob("params/*.yaml")),
        ("share/lfd_bringup/security", glob("security/*")),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The lfd developers",
    maintainer_email="lfd@example.com",
    description="Launch files, parameter files and the one-process replay.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [f"{name} = lfd_bringup.executables:{name}" for name in EXECUTABLES]
    },
)
