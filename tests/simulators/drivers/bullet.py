"""PyBullet: URDF only (its MJCF reader ignores limits given by autolimits, damping and the fixed base).

Three things a user must know: inertias are recomputed from bounding boxes unless `URDF_USE_INERTIA_FROM_FILE` is given,
every joint is held by a velocity motor until its force is set to 0, and joint friction is read but not simulated.
"""

import importlib.metadata

import numpy as np
from definition import Body, Engine, Limits

from . import captured
from .text import FILES, Posed

with captured():
    # It prints when it was built.
    import pybullet as bullet

# Nothing is spared: a part collides with its own furniture too.
FLAGS = (
    bullet.URDF_USE_INERTIA_FROM_FILE | bullet.URDF_USE_SELF_COLLISION | bullet.URDF_USE_SELF_COLLISION_INCLUDE_PARENT
)


def matrix(quaternion):
    return np.array(bullet.getMatrixFromQuaternion(quaternion)).reshape(3, 3)


class Urdf(Posed, Engine):
    format, simulator, version = "URDF", "PyBullet", importlib.metadata.version("pybullet")
    has_friction = False
    most = 4
    cannot = {5: "the text answers it", 14: "does not simulate joint friction"}

    def __init__(self, twin, step_secs=1 / 240):
        self.twin, self.step_secs = twin, step_secs
        with captured() as said:
            self.world = bullet.connect(bullet.DIRECT)
            self.kitchen = bullet.loadURDF(str(twin.folder / FILES["URDF"]), flags=FLAGS, physicsClientId=self.world)
        self.warnings = said.text
        bullet.setGravity(0, 0, -9.81, physicsClientId=self.world)
        bullet.setTimeStep(step_secs, physicsClientId=self.world)
        info = [bullet.getJointInfo(self.kitchen, i, physicsClientId=self.world) for i in range(self.count())]
        self.joint = {i[1].decode(): i for i in info if i[2] != bullet.JOINT_FIXED}
        self.link = {i[12].decode(): i[0] for i in info}
        self.fixed = {-1} | {i[0] for i in info if i[2] == bullet.JOINT_FIXED}
        for j in self.joint.values():
            bullet.setJointMotorControl2(
                self.kitchen, j[0], bullet.VELOCITY_CONTROL, force=0, physicsClientId=self.world
            )
        for i in range(-1, self.count()):
            # Drag through the air is no part of the model.
            bullet.changeDynamics(self.kitchen, i, linearDamping=0, angularDamping=0, physicsClientId=self.world)

    def __del__(self):
        bullet.disconnect(self.world)

    def count(self):
        return bullet.getNumJoints(self.kitchen, physicsClientId=self.world)

    def again(self, step_secs):
        return type(self)(self.twin, step_secs)

    def limits(self):
        # The axis is told in the principal axes of inertia: not compared.
        return {n: Limits(j[8], j[9], None, j[6], j[7], j[10], j[11]) for n, j in self.joint.items()}

    def bodies(self):
        self.put({})
        read = {}
        for name, i in self.link.items():
            mass, _, diagonal = bullet.getDynamicsInfo(self.kitchen, i, physicsClientId=self.world)[:3]
            center, turn = self.link_state(i)[:2]
            read[name] = Body(mass, np.array(center), matrix(turn) @ np.diag(diagonal) @ matrix(turn).T)
        return read

    def link_state(self, i):
        return bullet.getLinkState(self.kitchen, i, computeForwardKinematics=1, physicsClientId=self.world)

    def link_pose(self, link):
        position, turn = self.link_state(self.link[link])[4:6]
        return matrix(turn), np.array(position)

    def structure(self):
        if lost := set(self.twin.bodies) - set(self.link):
            yield f"links {sorted(lost)} are gone"
        if bullet.getDynamicsInfo(self.kitchen, -1, physicsClientId=self.world)[0] != 0:
            yield "the base is free"
        flags = bullet.VISUAL_SHAPE_DATA_TEXTURE_UNIQUE_IDS
        shown = bullet.getVisualShapeData(self.kitchen, flags=flags, physicsClientId=self.world)
        meshes = [s for s in shown if s[2] == bullet.GEOM_MESH]
        if len(meshes) != len(self.twin.look) or any(s[8] < 0 for s in meshes):
            yield f"{len(meshes)} meshes, the look has {len(self.twin.look)}; or one has no picture"

    def put(self, positions):
        for name, j in self.joint.items():
            bullet.resetJointState(self.kitchen, j[0], positions.get(name, 0.0), 0.0, physicsClientId=self.world)

    def step(self, pull=None):
        if pull is not None:
            part, force, point = pull
            link = self.link[part.link]
            bullet.applyExternalForce(
                self.kitchen, link, force.tolist(), point.tolist(), bullet.WORLD_FRAME, physicsClientId=self.world
            )
        bullet.stepSimulation(physicsClientId=self.world)

    def state(self, name):
        return bullet.getJointState(self.kitchen, self.joint[name][0], physicsClientId=self.world)[:2]

    def touching(self, within=0.0):
        bullet.performCollisionDetection(physicsClientId=self.world)
        found = bullet.getContactPoints(self.kitchen, self.kitchen, physicsClientId=self.world)
        names = {i: n for n, i in self.link.items()}
        moving = [c for c in found if not {c[3], c[4]} <= self.fixed]
        # Bullet keeps pairs that are up to 2 cm apart.
        return [(names[c[3]], names[c[4]], c[8]) for c in moving if c[8] < max(within, 0.0)]


READERS = [Urdf]
