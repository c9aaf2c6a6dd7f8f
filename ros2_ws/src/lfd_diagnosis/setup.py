from setuptools import setup

setup(
    name="lfd_diagnosis",
    version="0.1.0",
    packages=["lfd_diagnosis"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/lfd_diagnosis"]),
        ("share/lfd_diagnosis", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The lfd developers",
    maintainer_email="lfd@example.com",
    description="Fault indices, confidence and the verdict on every sensor.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "decision_node = lfd_diagnosis.executables:decision_node",
            "diagnosis_node = lfd_diagnosis.executables:diagnosis_node",
        ]
    },
)
