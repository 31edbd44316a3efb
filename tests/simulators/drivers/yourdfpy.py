"""yourdfpy: the reader behind many Python tools."""

import importlib.metadata

import numpy as np
import yourdfpy
from definition import Limits, Reader, all_but

from . import captured
from .text import FILES, Posed


class Urdf(Posed, Reader):
    format, simulator, version = "URDF", "yourdfpy", importlib.metadata.version("yourdfpy")
    cannot = all_but({1, 2, 9, 15}, "kinematics only")

    def __init__(self, twin):
        self.twin = twin
        with captured() as said:
            self.robot = yourdfpy.URDF.load(str(twin.folder / FILES["URDF"]))
            valid = self.robot.validate()
        shapes = self.robot.scene.geometry
        bare = [n for n in self.twin.look if getattr(shapes[n].visual.material, "image", None) is None]
        if bare:
            valid, self.robot.errors = False, [*self.robot.errors, f"no picture on {bare}"]
        self.warnings = said.text if valid else f"{said.text}\nvalidate() is False: {self.robot.errors}"

    def limits(self):
        read = {}
        for name, joint in self.robot.joint_map.items():
            if joint.type == "fixed":
                continue
            # It keeps some of the numbers as text.
            limit, dynamics = joint.limit, joint.dynamics
            rest = (float(x) for x in (dynamics.damping, dynamics.friction, limit.effort, limit.velocity))
            read[name] = Limits(float(limit.lower), float(limit.upper), np.array(joint.axis, float), *rest)
        return read

    def put(self, positions):
        self.robot.update_cfg(positions)

    def link_pose(self, link):
        pose = self.robot.get_transform(link)
        return pose[:3, :3], pose[:3, 3]


READERS = [Urdf]
