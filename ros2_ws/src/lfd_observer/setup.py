from setuptools import setup

setup(
    name="lfd_observer",
    version="0.1.0",
    packages=["lfd_observer"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/lfd_observer"]),
        ("share/lfd_observer", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The lfd developers",
    maintainer_email="lfd@example.com",
    description="Sliding mode observers: prediction horizons in, acceleration limits out.",
    license="Apache-2.0",
    entry_points={"console_scripts": ["observer_node = lfd_observer.executables:observer_node"]},
)
