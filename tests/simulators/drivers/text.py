"""URDF and MJCF as the XML they are: what no loader tells, because it repairs or drops it without a word."""

import pathlib
import re
import subprocess
import tempfile
import xml.etree.ElementTree as ET

import numpy as np
from definition import Body, Limits, Reader, Unanswered, all_but

FILES = {"URDF": "scene.urdf", "MJCF": "scene.xml", "glTF": "scene.glb", "USD": "scene.usda"}
SAFE = re.compile(r"[A-Za-z0-9_]+")


def numbers(text, default="0 0 0"):
    return np.array([float(x) for x in (text or default).split()])


def tensor(xx, yy, zz, xy, xz, yz):
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def parse(path):
    """The XML of a file with its <include>s in their places, as MuJoCo has it."""
    root = ET.parse(path).getroot()
    for parent in list(root.iter()):
        for i, child in reversed(list(enumerate(parent))):
            if child.tag == "include":
                parent[i : i + 1] = list(parse(path.parent / child.get("file")))
    return root


def model(twin, format):
    """The file with the bodies: a scene that includes it has only light and floor, and few readers follow it there."""
    path = twin.folder / FILES[format]
    included = ET.parse(path).getroot().find("include") if format == "MJCF" else None
    return path if included is None else path.parent / included.get("file")


def handles_in_links(twin, format):
    """Joint name -> where the file puts its handle in the frame of the moving link."""
    root, found = parse(model(twin, format)), {}
    for part in twin.parts:
        if format == "MJCF":
            site = root.find(f".//body[@name='{part.link}']/site[@name='{part.name}_handle']")
            found[part.name] = numbers(site.get("pos"))
        else:
            shapes = root.iterfind(f"link[@name='{part.link}']/collision")
            # The bar is the first of them.
            bar = next(s for s in shapes if "handle" in s.get("name", ""))
            found[part.name] = numbers(bar.find("origin").get("xyz"))
    return found


class Posed:
    """A reader that can `put` joints and tell a `link_pose` (rotation, position) places the handles of its file."""

    def handles(self, share):
        local = handles_in_links(self.twin, self.format)
        self.put({p.name: share * p.upper for p in self.twin.parts})
        poses = {p.name: self.link_pose(p.link) for p in self.twin.parts}
        return {name: position + rotation @ local[name] for name, (rotation, position) in poses.items()}


# `paws` itself, where it is given: point 17 writes the files again.
PAWS = None


def rewritten(twin, format):
    """The files that `paws export` makes of twin.json are the files that `paws twin` wrote."""
    if PAWS is None:
        raise Unanswered("asked with --paws")
    with tempfile.TemporaryDirectory() as folder:
        command = [PAWS, "export", twin.folder, "--format", format.lower(), "--out", folder]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        for again in sorted(f for f in pathlib.Path(folder).rglob("*") if f.is_file()):
            name = again.relative_to(folder)
            if again.read_bytes() != (twin.folder / name).read_bytes():
                yield f"paws export writes another {name} than paws twin"


class Text(Reader):
    """What both formats have in common."""

    simulator = "the text"

    def __init__(self, twin):
        self.path = twin.folder / FILES[self.format]
        self.root = parse(self.path)
        self.twin = twin

    def repeated(self, twin):
        return rewritten(twin, self.format)

    def badly_named(self, names):
        """Names that are unsafe or taken."""
        seen = set()
        for name in names:
            if not name or not SAFE.fullmatch(name):
                yield f'name "{name}"'
            if name in seen:
                yield f'name "{name}" is used twice'
            seen.add(name)


class Urdf(Text):
    format = "URDF"
    cannot = all_but({2, 3, 4, 5, 15, 17}, "text does not run")

    def limits(self):
        read = {}
        for joint in self.root.iterfind("joint"):
            if joint.get("type") == "fixed":
                continue
            limit, dynamics = joint.find("limit"), joint.find("dynamics")
            read[joint.get("name")] = Limits(
                *(float(limit.get(k)) for k in ("lower", "upper")),
                axis=numbers(joint.find("axis").get("xyz")),
                damping=float(dynamics.get("damping")),
                friction=float(dynamics.get("friction")),
                effort=float(limit.get("effort")),
                velocity=float(limit.get("velocity")),
            )
        return read

    def origins(self):
        """Link -> where it stands in the world when closed; no joint is turned against its parent."""
        at = {"world": np.zeros(3)}
        for joint in self.root.iterfind("joint"):
            origin = joint.find("origin")
            if origin is not None and numbers(origin.get("rpy")).any():
                raise ValueError(f"joint {joint.get('name')} is turned")
            xyz = numbers(origin.get("xyz") if origin is not None else None)
            at[joint.find("child").get("link")] = at[joint.find("parent").get("link")] + xyz
        return at

    def bodies(self):
        read, at = {}, self.origins()
        for link in self.root.iterfind("link"):
            inertial = link.find("inertial")
            if inertial is None:
                continue
            origin, inertia = inertial.find("origin"), inertial.find("inertia")
            if numbers(origin.get("rpy")).any():
                raise ValueError(f"{link.get('name')}: inertial is turned")
            read[link.get("name")] = Body(
                float(inertial.find("mass").get("value")),
                at[link.get("name")] + numbers(origin.get("xyz")),
                tensor(*(float(inertia.get(k)) for k in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"))),
            )
        return read

    def structure(self):
        compiler = self.root.find("mujoco/compiler")
        if compiler is None or (compiler.get("fusestatic"), compiler.get("discardvisual")) != ("false", "false"):
            yield "no <mujoco><compiler fusestatic=false discardvisual=false/>: MuJoCo fuses the bases away"
        welded = {
            j.find("child").get("link")
            for j in self.root.iterfind("joint[@type='fixed']")
            if j.find("parent").get("link") == "world"
        }
        for part in self.twin.parts:
            if part.base not in welded:
                yield f"{part.base} is not fixed to a link named world"
        world = self.root.find("link[@name='world']")
        if world is None or len(world):
            yield "the link world is missing or not empty"

    def names(self):
        named = [
            e.get("name") for tag in ("link", "joint", "link/visual", "link/collision") for e in self.root.iterfind(tag)
        ]
        yield from self.badly_named(named)
        for part in self.twin.parts:
            shapes = self.root.findall(f"link[@name='{part.link}']/collision")
            if not any("handle" in s.get("name", "") for s in shapes):
                yield f"{part.link}: no handle among its collision shapes"
        files = sorted(pathlib.Path(m.get("filename")) for m in self.root.iterfind("link/visual/geometry/mesh"))
        if [f.stem for f in files] != self.twin.look or not all((self.path.parent / f).is_file() for f in files):
            yield f"{len(files)} meshes are shown, the look has {len(self.twin.look)}"
        for shape in self.root.iterfind("link/collision/geometry/*"):
            if shape.tag != "box":
                yield f"a {shape.tag} collides: its convex hull would"


class Mjcf(Text):
    format = "MJCF"
    cannot = all_but({2, 3, 5, 6, 15, 17}, "text does not run")

    def limits(self):
        read = {}
        for joint in self.root.iterfind(".//body/joint"):
            low, high = numbers(joint.get("range"))
            read[joint.get("name")] = Limits(
                low, high, numbers(joint.get("axis")), float(joint.get("damping")), float(joint.get("frictionloss"))
            )
        return read

    def bodies(self):
        read = {}

        def visit(element, at):
            for inner in element.iterfind("body"):
                here = at + numbers(inner.get("pos"))
                if inner.get("quat") or inner.get("euler"):
                    raise ValueError(f"body {inner.get('name')} is turned")
                inertial = inner.find("inertial")
                if inertial is not None:
                    full = tensor(*numbers(inertial.get("fullinertia")))
                    read[inner.get("name")] = Body(
                        float(inertial.get("mass")), here + numbers(inertial.get("pos")), full
                    )
                visit(inner, here)

        visit(self.root.find("worldbody"), np.zeros(3))
        return read

    def names(self):
        for tag in ("body", "joint", "geom", "site", "material", "key"):
            yield from self.badly_named(
                [e.get("name") for e in self.root.iterfind(f".//{tag}") if e.get("name") or tag in ("body",)]
            )
        for part in self.twin.parts:
            found = self.root.find(f".//body[@name='{part.link}']")
            if found is None or found.find(f"site[@name='{part.name}_handle']") is None:
                yield f"{part.link}: no site {part.name}_handle"
            elif not any("handle" in g.get("name", "") for g in found.iterfind("geom")):
                yield f"{part.link}: no handle geom"
        shown = [g for g in self.root.iterfind(".//geom") if g.get("type") == "mesh"]
        if any(g.get("class") != "visual" for g in shown):
            yield "a mesh collides: MuJoCo takes its convex hull"
        if sorted(g.get("mesh") for g in shown) != self.twin.look:
            yield f"{len(shown)} meshes are shown, the look has {len(self.twin.look)}"
        for asset in self.root.iterfind("asset/*[@file]"):
            if not (self.path.parent / asset.get("file")).is_file():
                yield f"{asset.get('file')} is not there"

    def own(self):
        compiler = self.root.find("compiler")
        if compiler is None or (compiler.get("angle"), compiler.get("autolimits")) != ("radian", "true"):
            yield "no compiler angle=radian autolimits=true: degrees are read"
        defaults = {d.get("class"): d for d in self.root.iterfind(".//default[@class]")}

        def attribute(element, key):
            own = element.get(key)
            default = defaults.get(element.get("class"))
            child = default.find(element.tag) if default is not None else None
            return own if own is not None or child is None else child.get(key)

        for joint in self.root.iterfind(".//body/joint"):
            if attribute(joint, "limited") != "true":
                yield f"{joint.get('name')}: not limited=true"
        for found in self.root.iterfind(".//body"):
            if found.find("geom") is not None and found.find("inertial") is None:
                yield f"{found.get('name')}: no inertial"
            for geom in found.iterfind("geom"):
                if attribute(geom, "group") == "2" and (attribute(geom, "contype"), attribute(geom, "conaffinity")) != (
                    "0",
                    "0",
                ):
                    yield f"{geom.get('name')}: a visual geom that collides"
        pairs = {frozenset((e.get("body1"), e.get("body2"))) for e in self.root.iterfind("contact/exclude")}
        for part in self.twin.parts:
            if frozenset((part.base, part.link)) not in pairs:
                yield f"no exclude between {part.base} and {part.link}"


READERS = [Urdf, Mjcf]
