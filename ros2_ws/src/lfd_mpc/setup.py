from setuptools import setup

setup(
    name="lfd_mpc",
    version="0.1.0",
    packages=["lfd_mpc"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/lfd_mpc"]),
        ("share/lfd_mpc", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The lfd developers",
    maintainer_email="lfd@example.com",
    description="The 100 Hz model predictive controller: samples in, prediction horizons out.",
    license="Apache-2.0",
    entry_points={"console_scripts": ["mpc_node = lfd_mpc.executables:mpc_node"]},
)
