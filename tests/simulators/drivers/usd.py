"""USD: our own scene.usda where there is one, else what urdf-usd-converter (in its own environment) makes of the URDF.

OpenUSD's validators pass radians in a field of degrees, crooked joint frames and missing masses: those are read here.
"""

import importlib.metadata
import math
import pathlib
import subprocess
import tempfile

import numpy as np
from definition import Body, Limits, Reader, Unanswered, all_but, off
from pxr import Usd, UsdGeom, UsdPhysics, UsdValidation

from .text import FILES

CONVERT = "import sys, urdf_usd_converter; urdf_usd_converter.Converter().convert(*sys.argv[1:])"


def missing(folder):
    """Why it cannot run; `folder` is the converter's environment."""
    UsdCore.converter = folder / "bin/python" if folder and (folder / "bin/python").exists() else None
    return None


def array(quaternion):
    """Rotation matrix of a USD quaternion."""
    w, (x, y, z) = quaternion.GetReal(), quaternion.GetImaginary()
    q = np.array([w, x, y, z]) / np.linalg.norm([w, x, y, z])
    w, v = q[0], q[1:]
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


class UsdCore(Reader):
    format, simulator = "USD", "usd-core"
    version = importlib.metadata.version("usd-core")
    converter = None
    # Positions and degrees are single precision.
    exact = 1e-5
    cannot = all_but({1, 2, 3, 4, 8, 9, 15}, "a file format, nothing runs")

    def __init__(self, twin):
        self.twin = twin
        own = twin.folder / FILES["USD"]
        with tempfile.TemporaryDirectory() as folder:
            path = own if own.exists() else self.converted(twin, folder)
            self.stage = Usd.Stage.Open(str(path))
            self.stage.Load()
            self.found = UsdValidation.ValidationContext(
                UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
            ).Validate(self.stage)
        self.joints = {p.GetName(): p for p in self.stage.Traverse() if p.IsA(UsdPhysics.Joint)}
        self.links = {p.GetName(): p for p in self.stage.Traverse() if p.HasAPI(UsdPhysics.RigidBodyAPI)}
        self.poses = UsdGeom.XformCache()
        self.warnings = "\n".join(str(e.GetMessage()) for e in self.found)

    def converted(self, twin, folder):
        if self.converter is None:
            raise Unanswered("no scene.usda, and no urdf-usd-converter to make one")
        result = subprocess.run(
            [self.converter, "-c", CONVERT, twin.folder / FILES["URDF"], folder], capture_output=True, text=True
        )
        made = list(pathlib.Path(folder).glob("*.usda"))
        if result.returncode or len(made) != 1:
            raise RuntimeError(f"urdf-usd-converter: {result.stderr.strip()[-200:]}")
        return made[0]

    def pose(self, prim):
        """(rotation, position) in the world, closed."""
        m = np.array(self.poses.GetLocalToWorldTransform(prim)).T
        return m[:3, :3], m[:3, 3]

    def frames(self, joint):
        """Poses of both joint frames in the world, closed."""
        j = UsdPhysics.Joint(joint)
        for rel, place, turn in (
            (j.GetBody0Rel(), j.GetLocalPos0Attr(), j.GetLocalRot0Attr()),
            (j.GetBody1Rel(), j.GetLocalPos1Attr(), j.GetLocalRot1Attr()),
        ):
            targets = rel.GetTargets()
            rotation, position = (
                self.pose(self.stage.GetPrimAtPath(targets[0])) if targets else (np.eye(3), np.zeros(3))
            )
            yield rotation @ array(turn.Get()), position + rotation @ np.array(place.Get())

    def axis(self, joint):
        turn, _ = next(iter(self.frames(joint)))
        return turn[:, "XYZ".index(joint.GetAttribute("physics:axis").Get())]

    def limits(self):
        def value(joint, *names):
            found = [joint.GetAttribute(n).Get() for n in names if joint.HasAttribute(n)]
            return next((v for v in found if v is not None), None)

        read = {}
        for p in self.twin.parts:
            joint, unit = self.joints[p.name], math.pi / 180 if p.turns else 1.0
            drive = f"drive:{'angular' if p.turns else 'linear'}:physics"
            # Damping is per degree, too.
            damping, speed = value(joint, "newton:damping", f"{drive}:damping"), value(joint, "newton:velocityLimit")
            read[p.name] = Limits(
                value(joint, "physics:lowerLimit") * unit,
                value(joint, "physics:upperLimit") * unit,
                self.axis(joint),
                None if damping is None else damping / unit,
                value(joint, "newton:friction"),
                value(joint, "urdf:limit:effort", f"{drive}:maxForce"),
                None if speed is None else speed * unit,
            )
        return read

    def bodies(self):
        read = {}
        for name, prim in self.links.items():
            api = UsdPhysics.MassAPI(prim)
            turn, place = self.pose(prim)
            own = turn @ array(api.GetPrincipalAxesAttr().Get())
            inertia = own @ np.diag(np.array(api.GetDiagonalInertiaAttr().Get(), float)) @ own.T
            read[name] = Body(
                api.GetMassAttr().Get(), place + turn @ np.array(api.GetCenterOfMassAttr().Get(), float), inertia
            )
        return read

    def handles(self, share):
        at = {}
        for p in self.twin.parts:
            (_, origin), axis, q = (
                next(iter(self.frames(self.joints[p.name]))),
                self.axis(self.joints[p.name]),
                share * p.upper,
            )
            r = p.handle - origin
            turned = r * math.cos(q) + np.cross(axis, r) * math.sin(q) + axis * (axis @ r) * (1 - math.cos(q))
            at[p.name] = origin + turned if p.turns else p.handle + axis * q
        return at

    def structure(self):
        fixed = {
            str(t)
            for j in self.joints.values()
            if j.IsA(UsdPhysics.FixedJoint)
            for t in UsdPhysics.Joint(j).GetBody1Rel().GetTargets()
        }
        roots = [p for p in self.stage.Traverse() if p.HasAPI(UsdPhysics.ArticulationRootAPI)]
        for a in roots:
            if any(a != b and a.GetPath().HasPrefix(b.GetPath()) for b in roots):
                yield f"{a.GetName()}: an articulation inside another"
        for p in self.twin.parts:
            if p.base not in self.links or str(self.links[p.base].GetPath()) not in fixed:
                yield f"{p.base} is not fixed"

    def own(self):
        if not self.stage.GetDefaultPrim():
            yield "no defaultPrim"
        if UsdGeom.GetStageUpAxis(self.stage) != "Z" or UsdGeom.GetStageMetersPerUnit(self.stage) != 1.0:
            yield "not +Z up in metres"
        if not any(p.IsA(UsdPhysics.Scene) for p in self.stage.Traverse()):
            yield "no PhysicsScene"
        if not any(p.HasAPI(UsdPhysics.ArticulationRootAPI) for p in self.stage.Traverse()):
            yield "no ArticulationRootAPI"
        colliding = {
            n for n, p in self.links.items() if any(c.HasAPI(UsdPhysics.CollisionAPI) for c in Usd.PrimRange(p))
        }
        for name in sorted(set(self.twin.bodies) - colliding):
            yield f"{name}: nothing of it collides"
        for p in self.twin.parts:
            (turn_a, at_a), (turn_b, at_b) = self.frames(self.joints[p.name])
            if off(turn_a, turn_b) > 1e-5 or off(at_a, at_b) > 1e-5:
                yield f"{p.name}: the joint's frames are {off(at_a, at_b):.2g} m and {off(turn_a, turn_b):.2g} apart"


READERS = [UsdCore]
