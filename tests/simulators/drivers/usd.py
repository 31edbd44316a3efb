"""USD: our own scene.usda, and what urdf-usd-converter (in its own environment) makes of the URDF.

OpenUSD's validators pass radians in a field of degrees, crooked joint frames and missing masses: those are read here.
"""

import importlib.metadata
import math
import pathlib
import subprocess
import tempfile

import numpy as np
from definition import Body, Limits, Reader, Unanswered, all_but, off
from pxr import Usd, UsdGeom, UsdPhysics, UsdShade, UsdValidation

from .text import FILES, SAFE, rewritten

CONVERT = "import sys, urdf_usd_converter; urdf_usd_converter.Converter().convert(*sys.argv[1:])"


def missing(folder):
    """Why it cannot run; `folder` is the converter's environment."""
    Converted.converter = folder / "bin/python" if folder and (folder / "bin/python").exists() else None
    return None


def array(quaternion):
    """Rotation matrix of a USD quaternion."""
    w, (x, y, z) = quaternion.GetReal(), quaternion.GetImaginary()
    q = np.array([w, x, y, z]) / np.linalg.norm([w, x, y, z])
    w, v = q[0], q[1:]
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


def finite(value):
    """None where a value is left open."""
    return None if value is None or not math.isfinite(value) else value


class Stage(Reader):
    """A USD file through usd-core."""

    format = "USD"
    version = importlib.metadata.version("usd-core")
    # Positions and degrees are single precision.
    exact = 1e-5

    def __init__(self, twin):
        self.twin = twin
        with tempfile.TemporaryDirectory() as folder:
            self.stage = Usd.Stage.Open(str(self.path(folder)))
            self.stage.Load()
            self.found = UsdValidation.ValidationContext(
                UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
            ).Validate(self.stage)
        self.joints = {p.GetName(): p for p in self.stage.Traverse() if p.IsA(UsdPhysics.Joint)}
        self.links = {p.GetName(): p for p in self.stage.Traverse() if p.HasAPI(UsdPhysics.RigidBodyAPI)}
        self.poses = UsdGeom.XformCache()
        self.warnings = "\n".join(str(e.GetMessage()) for e in self.found)

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
                finite(value(joint, "urdf:limit:effort", f"{drive}:maxForce")),
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

    def handle(self, part):
        """Where the file has the handle of a closed part."""
        return part.handle

    def handles(self, share):
        at = {}
        for p in self.twin.parts:
            (_, origin), axis = next(iter(self.frames(self.joints[p.name]))), self.axis(self.joints[p.name])
            q, handle = share * p.upper, self.handle(p)
            r = handle - origin
            turned = r * math.cos(q) + np.cross(axis, r) * math.sin(q) + axis * (axis @ r) * (1 - math.cos(q))
            at[p.name] = origin + turned if p.turns else handle + axis * q
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


class UsdCore(Stage):
    """Our own file."""

    simulator, springs = "usd-core", True
    cannot = all_but({1, 2, 3, 4, 5, 8, 9, 15, 17}, "a file format, nothing runs")

    def path(self, _):
        return self.twin.folder / FILES["USD"]

    def handle(self, part):
        return self.pose(self.links[part.link].GetChild(f"{part.name}_handle"))[1]

    def names(self):
        boxes = [p for p in self.stage.Traverse() if p.HasAPI(UsdPhysics.CollisionAPI)]
        yield from (f'name "{p.GetName()}"' for p in self.stage.Traverse() if not SAFE.fullmatch(p.GetName()))
        if len(boxes) != self.twin.boxes or not all(b.IsA(UsdGeom.Cube) for b in boxes):
            yield f"{len(boxes)} colliders, the twin has {self.twin.boxes} boxes"
        for b in boxes:
            # One of side 1 is taken for one of side 2 by some readers.
            if UsdGeom.Cube(b).GetSizeAttr().Get() != 2:
                yield f"{b.GetName()}: a cube of another side than 2"
        for p in self.twin.parts:
            if not self.links[p.link].GetChild(f"{p.name}_handle"):
                yield f"{p.link}: no prim {p.name}_handle"

    def repeated(self, twin):
        return rewritten(twin, self.format)

    def looks(self, stage):
        """What a stage lacks of the look."""
        meshes = sorted(p.GetName() for p in stage.Traverse() if p.IsA(UsdGeom.Mesh))
        if meshes != self.twin.look:
            yield f"{len(meshes)} meshes, the look has {len(self.twin.look)}"
        for mesh in (p for p in stage.Traverse() if p.IsA(UsdGeom.Mesh)):
            material = UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()[0].GetPrim()
            picture = stage.GetPrimAtPath(f"{material.GetPath()}/picture").GetAttribute("inputs:file").Get()
            if not picture.resolvedPath or not UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").HasValue():
                yield f"{mesh.GetName()}: no picture, or no texture coordinates"
        guides = [p for p in stage.Traverse() if p.IsA(UsdGeom.Cube) and UsdGeom.Imageable(p).ComputePurpose() == "guide"]
        if len(guides) != self.twin.hidden:
            yield f"{len(guides)} boxes are guides, not {self.twin.hidden}"

    def own(self):
        yield from super().own()
        yield from self.looks(self.stage)
        package = self.twin.folder / "scene.usdz"
        if package.exists():
            yield from (f"{package.name}: {fault}" for fault in self.looks(Usd.Stage.Open(str(package))))
        parsed = {
            kind: dict(zip((str(path) for path in paths), descriptions))
            for kind, (paths, descriptions) in UsdPhysics.LoadUsdPhysicsFromRange(self.stage, ["/"]).items()
        }
        kinds = UsdPhysics.ObjectType
        yield from (f"{path}: not valid" for found in parsed.values() for path, d in found.items() if not d.isValid)
        # The fixed joint is the root: the engine sees a base that cannot move.
        articulations = parsed.get(kinds.Articulation, {}).values()
        roots = sorted(path.name for a in articulations for path in a.rootPrims)
        if roots != sorted(f"{p.base}_fixed" for p in self.twin.parts):
            yield f"articulations have their roots at {roots}"
        if any(len([b for b in a.articulatedBodies if b]) != 2 for a in articulations):
            yield "an articulation of more or less than a base and its part"
        for p in self.twin.parts:
            prim = self.joints[p.name]
            joint = parsed.get(kinds.RevoluteJoint if p.turns else kinds.PrismaticJoint, {}).get(str(prim.GetPath()))
            if joint is None:
                yield f"{p.name}: not a {p.kind} joint"
                continue
            unit = math.pi / 180 if p.turns else 1.0
            if not joint.limit.enabled or off(joint.limit.upper * unit, p.upper) > 1e-5:
                yield f"{p.name}: opens by {joint.limit.upper}, the model by {p.upper / unit}"
            if joint.collisionEnabled:
                yield f"{p.name}: its bodies collide"
            gravity = self.links[p.link].GetAttribute("physxRigidBody:disableGravity")
            if bool(gravity and gravity.Get()) != p.balanced:
                yield f"{p.link}: gravity pulls where a spring carries, or does not where none does"
        fixed = [s for s in parsed.get(kinds.CubeShape, {}).values() if not s.rigidBody]
        if len(fixed) != len(self.twin.room):
            yield f"{len(fixed)} boxes without a body, the room has {len(self.twin.room)}"


class Converted(Stage):
    """What urdf-usd-converter makes of our URDF: a check of the URDF more than of the USD."""

    simulator = "converted URDF"
    converter = None
    cannot = all_but({1, 2, 3, 4, 8, 9, 15}, "a file format, nothing runs")

    def path(self, folder):
        if self.converter is None:
            raise Unanswered("no urdf-usd-converter")
        result = subprocess.run(
            [self.converter, "-c", CONVERT, self.twin.folder / FILES["URDF"], folder], capture_output=True, text=True
        )
        made = list(pathlib.Path(folder).glob("*.usda"))
        if result.returncode or len(made) != 1:
            raise RuntimeError(f"urdf-usd-converter: {result.stderr.strip()[-200:]}")
        return made[0]


READERS = [UsdCore, Converted]
