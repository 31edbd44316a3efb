"""Drake, URDF and MJCF. Joint friction, sites and keyframes are not supported by it: it says so for each of them."""

import importlib.metadata
import logging
import math

import numpy as np
from definition import Body, Engine, Limits
from pydrake.common.value import Value
from pydrake.geometry import Box
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, ExternallyAppliedSpatialForce
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from .text import Posed, model


class Heard(logging.Handler):
    """Keeps what Drake says."""

    lines: list[str] = []

    def emit(self, record):
        self.lines.append(record.getMessage().replace("\n", " "))


logging.getLogger("drake").addHandler(Heard())
logging.getLogger("drake").propagate = False


class Drake(Posed, Engine):
    simulator = "Drake"
    version = importlib.metadata.version("drake")
    has_friction = False
    most = 2
    harmless = {
        "does not currently support non-zero joint friction": "friction is for the engines that have it",
        "The texture element is not supported": "of no effect on the physics",
        "tag '(light|site|keyframe|visual)' found .* unsupported": "of no effect on the physics",
        "attribute '(integrator|frictionloss)' .* unsupported": "Drake has its own integrator and no joint friction",
        "attribute 'gravcomp' .* unsupported": "it has no springs that carry a part",
        "half spaces are not currently supported for deformable contact": "nothing here is deformable",
    }

    def __init__(self, twin, step_secs=2e-3):
        self.twin, self.step_secs = twin, step_secs
        Heard.lines.clear()
        builder = DiagramBuilder()
        self.plant, self.scene = AddMultibodyPlantSceneGraph(builder, step_secs)
        Parser(self.plant).AddModels(str(model(twin, self.format)))
        self.plant.Finalize()
        self.diagram = builder.Build()
        self.time = math.nan
        self.put({})
        self.warnings = "\n".join(Heard.lines)

    def again(self, step_secs):
        return type(self)(self.twin, step_secs)

    def limits(self):
        read = {}
        for p in self.twin.parts:
            j = self.plant.GetJointByName(p.name)
            low, high, speed = j.position_lower_limits()[0], j.position_upper_limits()[0], j.velocity_upper_limits()[0]
            axis = j.revolute_axis() if p.turns else j.translation_axis()
            read[p.name] = Limits(low, high, axis, j.default_damping(), velocity=None if np.isinf(speed) else speed)
        return read

    def bodies(self):
        self.put({})
        read = {}
        for name in self.twin.bodies:
            link = self.plant.GetBodyByName(name)
            inertia = link.CalcSpatialInertiaInBodyFrame(self.context)
            turn, position = self.link_pose(name)
            about = inertia.Shift(inertia.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
            read[name] = Body(inertia.get_mass(), position + turn @ inertia.get_com(), turn @ about @ turn.T)
        return read

    def link_pose(self, link):
        pose = self.plant.EvalBodyPoseInWorld(self.context, self.plant.GetBodyByName(link))
        return pose.rotation().matrix(), pose.translation()

    def structure(self):
        if self.plant.num_positions() != len(self.twin.parts):
            yield f"{self.plant.num_positions()} coordinates for {len(self.twin.parts)} joints: the base is free"
        total = self.plant.CalcTotalMass(self.context)
        if abs(total - self.twin.mass) > 1e-3 * self.twin.mass:
            yield f"{total:.3f} kg, the twin has {self.twin.mass:.3f} kg"

    def put(self, positions):
        # What has not been stepped is as new, and a new one takes ten times as long as the rest.
        if self.time != 0.0:
            self.simulator_ = Simulator(self.diagram)
            root = self.simulator_.get_mutable_context()
            self.context = self.plant.GetMyMutableContextFromRoot(root)
            self.geometry = self.scene.GetMyContextFromRoot(root)
        for p in self.twin.parts:
            joint = self.plant.GetJointByName(p.name)
            q = positions.get(p.name, 0.0)
            (joint.set_angle if p.turns else joint.set_translation)(self.context, q)
        self.time = 0.0

    def step(self, pull=None):
        if self.time == 0.0:
            self.simulator_.Initialize()
        if pull is not None:
            part, force, point = pull
            link = self.plant.GetBodyByName(part.link)
            push = ExternallyAppliedSpatialForce()
            push.body_index = link.index()
            push.p_BoBq_B = self.plant.EvalBodyPoseInWorld(self.context, link).inverse() @ point
            push.F_Bq_W = SpatialForce(np.zeros(3), force)
            self.plant.get_applied_spatial_force_input_port().FixValue(self.context, Value([push]))
        self.time += self.step_secs
        self.simulator_.AdvanceTo(self.time)

    def state(self, name):
        joint = self.plant.GetJointByName(name)
        if joint.type_name() == "revolute":
            return joint.get_angle(self.context), joint.get_angular_rate(self.context)
        return joint.get_translation(self.context), joint.get_translation_rate(self.context)

    def kinetic(self, part):
        dof = self.plant.GetJointByName(part.name).velocity_start()
        return 0.5 * self.plant.CalcMassMatrix(self.context)[dof, dof] * self.state(part.name)[1] ** 2

    def touching(self, within=0.0):
        query = self.scene.get_query_output_port().Eval(self.geometry)
        inspector = query.inspector()
        names = inspector.GetName
        if within > 0:
            # It knows no distance to the floor.
            solid = lambda i: isinstance(inspector.GetShape(i), Box)
            pairs = [(a, b) for a, b in inspector.GetCollisionCandidates() if solid(a) and solid(b)]
            found = [query.ComputeSignedDistancePairClosestPoints(a, b) for a, b in pairs]
            return [(names(c.id_A), names(c.id_B), c.distance) for c in found if c.distance < within]
        return [(names(c.id_A), names(c.id_B), -c.depth) for c in query.ComputePointPairPenetration()]


class Urdf(Drake):
    format = "URDF"
    cannot = {5: "the text answers it", 14: "does not simulate joint friction"}


DRIVEN = "the same plant as from the URDF, which is driven"


class Mjcf(Drake):
    format = "MJCF"
    cannot = {
        **Urdf.cannot,
        6: "the text and MuJoCo answer it",
        12: DRIVEN,
        13: DRIVEN,
        16: "does not simulate joint friction",
        17: DRIVEN,
    }


READERS = [Urdf, Mjcf]
