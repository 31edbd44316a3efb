"""Pinocchio: kinematics and inertias of URDF and MJCF. It has no contacts and no stops, so nothing moves here."""

import numpy as np
import pinocchio
from definition import Body, Limits, Reader, all_but

from . import captured
from .text import Posed, model


class Pinocchio(Posed, Reader):
    simulator, version = "Pinocchio", pinocchio.__version__

    def __init__(self, twin):
        self.twin = twin
        with captured() as said:
            self.model = self.build(str(model(twin, self.format)))
        self.warnings = said.text
        self.data = self.model.createData()

    def limits(self):
        read, m = {}, self.model
        for i in range(1, m.njoints):
            q, v = m.idx_qs[i], m.idx_vs[i]
            low, high = m.lowerPositionLimit[q], m.upperPositionLimit[q]
            effort, speed = (x if np.isfinite(x) else None for x in (m.upperEffortLimit[v], m.upperVelocityLimit[v]))
            read[m.names[i]] = Limits(low, high, None, m.damping[v], m.upperDryFrictionLimit[v], effort, speed)
        return read

    def put(self, positions):
        q = pinocchio.neutral(self.model)
        for name, value in positions.items():
            q[self.model.idx_qs[self.model.getJointId(name)]] = value
        pinocchio.framesForwardKinematics(self.model, self.data, q)

    def bodies(self):
        # Bases are melted into the universe: they are compared by their mass, in `structure`.
        self.put({})
        read = {p.base: self.twin.bodies[p.base] for p in self.twin.parts}
        for p in self.twin.parts:
            i = self.model.getJointId(p.name)
            inertia, place = self.model.inertias[i], self.data.oMi[i]
            read[p.link] = Body(
                inertia.mass, place.act(inertia.lever), place.rotation @ inertia.inertia @ place.rotation.T
            )
        return read

    def link_pose(self, link):
        pose = self.data.oMf[self.model.getFrameId(link)]
        return pose.rotation.copy(), pose.translation.copy()

    def structure(self):
        if self.model.nq != len(self.twin.parts):
            yield f"{self.model.nq} coordinates for {len(self.twin.parts)} joints"
        total = sum(i.mass for i in self.model.inertias)
        if abs(total - self.twin.mass) > 1e-3 * self.twin.mass:
            yield f"{total:.3f} kg, the twin has {self.twin.mass:.3f} kg"


class Urdf(Pinocchio):
    format, build = "URDF", staticmethod(pinocchio.buildModelFromUrdf)
    cannot = all_but({1, 2, 3, 4, 9, 15}, "kinematics and inertias only: no contacts, no stops")


class Mjcf(Pinocchio):
    format, build = "MJCF", staticmethod(pinocchio.buildModelFromMJCF)
    cannot = Urdf.cannot


READERS = [Urdf, Mjcf]
