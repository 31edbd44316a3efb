"""SAPIEN: URDF on PhysX's CPU solver, with or without a device to draw on.

Five things a user must know: without a Vulkan device its loader fails at the first shape that is only to be seen (here
it then gets the URDF without these), it drops joint friction and puts PhysX's own coefficient of 0.05 in its place, a
part never collides with the furniture that it hangs in, all links are slowed down by the air, and shapes that pass each
other at millimetres collide unless the contact offset is smaller than their gap.
"""

import importlib.metadata
import pathlib
import tempfile
import xml.etree.ElementTree as ET

import numpy as np
import sapien
from definition import Body, Engine, Limits
from sapien import physx

from . import captured
from .text import FILES, Posed, parse

# Its log says what it builds and deletes.
sapien.set_log_level("warn")
# What stands still would fall asleep and take a weak pull for none.
physx.set_body_config(sleep_threshold=0.0)
# Two shapes are near from twice this distance on: a little more than the clearance that is asked for, less than the gap
# between a front and its neighbours. At 5 mm a flap was held up by a board that it passes at 1.5 mm; SAPIEN's own is 1 cm.
physx.set_shape_config(contact_offset=0.0006, rest_offset=0.0)


def can_draw():
    """Whether there is a device that meshes and pictures can be put on."""
    try:
        with captured():
            sapien.render.RenderShapeBox([0.1, 0.1, 0.1], sapien.render.RenderMaterial())
    except RuntimeError:
        return False
    return True


DRAWS = can_draw()


def builders(loader, file):
    """What its loader makes of a file, before it is built."""
    if DRAWS:
        return loader.parse(str(file))
    root = parse(file)
    for link in root.iterfind("link"):
        for shape in link.findall("visual"):
            link.remove(shape)
    with tempfile.TemporaryDirectory() as folder:
        unseen = pathlib.Path(folder) / file.name
        ET.ElementTree(root).write(unseen)
        return loader.parse(str(unseen))


def matrix(pose):
    return np.array(pose.to_transformation_matrix(), float)


class Urdf(Posed, Engine):
    format, simulator, version = "URDF", "SAPIEN", importlib.metadata.version("sapien")
    has_friction = False
    most = 4
    cannot = {5: "the text answers it", 14: "its reader of URDFs drops joint friction"}

    def __init__(self, twin, step_secs=1 / 240):
        self.twin, self.step_secs = twin, step_secs
        with captured() as said:
            self.scene = sapien.Scene([physx.PhysxCpuSystem()])
            found, loose, _ = builders(self.scene.create_urdf_loader(), twin.folder / FILES["URDF"])
            if len(found) != 1 or loose:
                raise ValueError(f"{len(found)} articulations and {len(loose)} loose bodies, not one articulation")
            self.kitchen = found[0].build()
        self.warnings = said.text
        self.scene.set_timestep(step_secs)
        self.link = {link.name: link for link in self.kitchen.links}
        self.joint = {joint.name: joint for joint in self.kitchen.active_joints}
        self.order = {joint.name: i for i, joint in enumerate(self.kitchen.active_joints)}
        for link in self.kitchen.links:
            # Drag through the air is no part of the model.
            link.linear_damping = link.angular_damping = 0.0
        for joint in self.joint.values():
            joint.friction = 0.0
        self.is_stepped = False

    def again(self, step_secs):
        return type(self)(self.twin, step_secs)

    def limits(self):
        # It keeps the axis as the x of a frame in the moving link.
        read = {}
        for name, joint in self.joint.items():
            low, high = joint.limits[0]
            axis = matrix(joint.child_link.entity.pose)[:3, :3] @ matrix(joint.pose_in_child)[:3, 0]
            read[name] = Limits(float(low), float(high), axis, joint.damping)
        return read

    def bodies(self):
        self.put({})
        read = {}
        for name, link in self.link.items():
            if name not in self.twin.bodies:
                continue
            pose = matrix(link.entity.pose) @ matrix(link.cmass_local_pose)
            turn = pose[:3, :3]
            read[name] = Body(link.mass, pose[:3, 3], turn @ np.diag(link.inertia.astype(float)) @ turn.T)
        return read

    def link_pose(self, link):
        pose = matrix(self.link[link].entity.pose)
        return pose[:3, :3], pose[:3, 3]

    def structure(self):
        if lost := set(self.twin.bodies) - set(self.link):
            yield f"links {sorted(lost)} are gone"
        if self.kitchen.dof != len(self.twin.parts):
            yield f"{self.kitchen.dof} coordinates for {len(self.twin.parts)} joints"
        if self.kitchen.root.joint.type != "fixed":
            yield "the base is free"
        total = sum(link.mass for link in self.kitchen.links)
        if abs(total - self.twin.mass) > 1e-3 * self.twin.mass:
            yield f"{total:.3f} kg, the twin has {self.twin.mass:.3f} kg"
        shapes = sum(len(link.collision_shapes) for link in self.kitchen.links)
        if shapes != self.twin.boxes:
            yield f"{shapes} boxes collide, the twin has {self.twin.boxes}"
        if DRAWS:
            yield from self.drawn()

    def drawn(self):
        """Meshes that are lost, or drawn without a picture."""
        bodies = [link.entity.find_component_by_type(sapien.render.RenderBodyComponent) for link in self.kitchen.links]
        shapes = [shape for body in bodies if body for shape in body.render_shapes]
        meshes = [shape for shape in shapes if isinstance(shape, sapien.render.RenderShapeTriangleMesh)]
        if len(meshes) != len(self.twin.look):
            yield f"{len(meshes)} meshes, the look has {len(self.twin.look)}"
        if any(part.material.base_color_texture is None for mesh in meshes for part in mesh.parts):
            yield "a mesh without a picture"

    def put(self, positions):
        self.kitchen.qpos = [positions.get(name, 0.0) for name in self.order]
        self.kitchen.qvel = np.zeros(len(self.order))
        self.is_stepped = False

    def step(self, pull=None):
        if pull is not None:
            part, force, point = pull
            self.link[part.link].add_force_at_point(force, point)
        self.scene.step()
        self.is_stepped = True

    def state(self, name):
        i = self.order[name]
        return float(self.kitchen.qpos[i]), float(self.kitchen.qvel[i])

    def touching(self, within=0.0):
        # Contacts are those of the place from which the last step began.
        if not self.is_stepped:
            self.step()
        found = []
        moving = {part.link for part in self.twin.parts}
        for contact in self.scene.physx_system.get_contacts():
            names = [body.name for body in contact.bodies]
            nearest = min((point.separation for point in contact.points), default=np.inf)
            if moving & set(names) and nearest < max(within, 0.0):
                found.append((*names, float(nearest)))
        return found


READERS = [Urdf]
