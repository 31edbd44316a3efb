"""MuJoCo, both formats."""

import mujoco
import numpy as np
import replay
from definition import Body, Engine, Limits

from . import captured
from .text import FILES, Posed


class MuJoCo(Posed, Engine):
    simulator = "MuJoCo"
    version = mujoco.__version__

    def __init__(self, twin, step_secs=None):
        self.twin, self.path = twin, str(twin.folder / FILES[self.format])
        with captured() as said:
            self.model = mujoco.MjModel.from_xml_path(self.path)
            # Distances without the excludes: what touches only because it is excluded is a fault all the same.
            self.bare = mujoco.MjModel.from_xml_path(self.path)
        self.warnings = said.text
        self.bare.exclude_signature[:] = 0
        self.model.opt.timestep = step_secs or self.model.opt.timestep
        self.step_secs = self.model.opt.timestep
        self.data, self.near = mujoco.MjData(self.model), mujoco.MjData(self.bare)
        self.armature = float(self.model.dof_armature.max(initial=0.0))
        self.joint = {self.model.joint(i).name: self.model.joint(i) for i in range(self.model.njnt)}
        self.link = {self.model.body(i).name: i for i in range(self.model.nbody)}

    def again(self, step_secs):
        return type(self)(self.twin, step_secs)

    def limits(self):
        read = {}
        for name, j in self.joint.items():
            dof, effort = j.dofadr[0], None
            if self.model.jnt_actfrclimited[j.id]:
                effort = self.model.jnt_actfrcrange[j.id][1]
            low, high = self.model.jnt_range[j.id] if self.model.jnt_limited[j.id] else (-np.inf, np.inf)
            damping, friction = self.model.dof_damping[dof], self.model.dof_frictionloss[dof]
            read[name] = Limits(low, high, self.model.jnt_axis[j.id], np.ravel(damping)[0], friction, effort)
        return read

    def bodies(self):
        self.put({})
        read = {}
        for name, i in self.link.items():
            turn = self.data.ximat[i].reshape(3, 3)
            inertia = turn @ np.diag(self.model.body_inertia[i]) @ turn.T
            if self.model.body_mass[i] > 0:
                read[name] = Body(self.model.body_mass[i], self.data.xipos[i].copy(), inertia)
        return read

    def link_pose(self, link):
        i = self.link[link]
        return self.data.xmat[i].reshape(3, 3).copy(), self.data.xpos[i].copy()

    def structure(self):
        if lost := set(self.twin.bodies) - set(self.link):
            yield f"bodies {sorted(lost)} are gone"
        if self.model.nq != len(self.twin.parts):
            yield f"{self.model.nq} coordinates for {len(self.twin.parts)} joints"
        if abs(self.model.body_mass.sum() - self.twin.mass) > 1e-3 * self.twin.mass:
            yield f"{self.model.body_mass.sum():.3f} kg, the twin has {self.twin.mass:.3f} kg"

    def own(self):
        boxes = self.model.geom_type == mujoco.mjtGeom.mjGEOM_BOX
        visual = boxes & (self.model.geom_contype == 0) & (self.model.geom_conaffinity == 0)
        wanted = self.twin.boxes
        shown = wanted - self.twin.hidden
        if visual.sum() != shown or (boxes & ~visual).sum() != wanted:
            yield f"{visual.sum()} visual and {(boxes & ~visual).sum()} colliding boxes, not {shown} and {wanted}"
        meshes = np.flatnonzero(self.model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)
        if len(meshes) != len(self.twin.look):
            yield f"{len(meshes)} meshes, the look has {len(self.twin.look)}"
        if self.model.geom_contype[meshes].any() or self.model.geom_conaffinity[meshes].any():
            yield "a mesh collides"
        # A geom without a material has number -1, a material without a picture too.
        materials = self.model.geom_matid[meshes]
        if (materials < 0).any() or (self.model.mat_texid[materials].max(axis=1, initial=-1) < 0).any():
            yield "a mesh without a picture"

    def put(self, positions):
        mujoco.mj_resetData(self.model, self.data)
        for name, q in positions.items():
            self.data.qpos[self.joint[name].qposadr[0]] = q
        mujoco.mj_forward(self.model, self.data)

    def step(self, pull=None):
        self.data.qfrc_applied[:] = 0
        if pull is not None:
            part, force, point = pull
            mujoco.mj_applyFT(
                self.model, self.data, force, np.zeros(3), point, self.link[part.link], self.data.qfrc_applied
            )
        mujoco.mj_step(self.model, self.data)

    def state(self, name):
        j = self.joint[name]
        return float(self.data.qpos[j.qposadr[0]]), float(self.data.qvel[j.dofadr[0]])

    def kinetic(self, part):
        dof = self.joint[part.name].dofadr[0]
        # The diagonal is the last of each row.
        diagonal = self.data.M[self.model.M_rowadr[dof] + self.model.M_rownnz[dof] - 1]
        return 0.5 * float(diagonal * self.data.qvel[dof] ** 2)

    def touching(self, within=0.0):
        self.bare.geom_margin[:] = within
        self.near.qpos[:] = self.data.qpos
        mujoco.mj_fwdPosition(self.bare, self.near)
        name = lambda geom: (
            self.bare.geom(geom).name or f"a shape of {self.bare.body(self.bare.geom_bodyid[geom]).name}"
        )
        return [(name(c.geom1), name(c.geom2), float(c.dist)) for c in self.near.contact[: self.near.ncon]]

    def complaints(self):
        return ", ".join(f"MuJoCo warning {i}" for i, w in enumerate(self.data.warning) if w.number)


class Urdf(MuJoCo):
    format = "URDF"
    cannot = {5: "the text answers it"}


class Mjcf(MuJoCo):
    format, springs = "MJCF", True
    cannot = Urdf.cannot

    def alone(self, clip, step_secs):
        engine = self.again(step_secs)
        model = engine.model
        boxes = (model.geom_type == mujoco.mjtGeom.mjGEOM_BOX) & (model.geom_contype != 0)
        # Its own furniture, too, is in a part's way; the floor below everything is none of rapier's.
        model.exclude_signature[:] = 0
        model.geom_contype[:] = 0
        model.geom_conaffinity[:] = np.where(boxes, 2**31 - 1, 0)
        model.geom_friction[:, 0] = replay.RUBBING
        own = np.flatnonzero(boxes & (model.geom_bodyid == engine.link[clip.part.link]))
        for bit, geom in enumerate(own):
            model.geom_contype[geom], model.geom_conaffinity[geom] = 1 << bit, 0
        for mine, other in clip.apart:
            model.geom_conaffinity[model.geom(other).id] &= ~model.geom_contype[model.geom(mine).id]
        return engine


READERS = [Urdf, Mjcf]
