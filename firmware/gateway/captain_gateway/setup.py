"""Setup of captain_gateway as an ament_python package, for colcon and pip."""

from glob import glob

from setuptools import setup

NAME = "captain_gateway"

setup(
    name=NAME,
    version="0.1.0",
    description="Between the endpoint of a V2X station and ROS topics",
    license="Apache-2.0",
    packages=[NAME, f"{NAME}.handlers"],
    python_requires=">=3.10",
    install_requires=["setuptools", "pyzmq"],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", sorted(glob("config/*.yaml"))),
        (f"share/{NAME}/launch", sorted(glob("launch/*.py"))),
    ],
    entry_points={"console_scripts": [f"captain_gateway = {NAME}.__main__:main"]},
)
