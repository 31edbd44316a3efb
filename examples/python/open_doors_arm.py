#!/usr/bin/env python3
"""A Franka Panda opens and closes the joints of a twin in MuJoCo, by its primitives.

    pip install mujoco numpy mink gymnasium-robotics
    paws demo --out demo
    python examples/python/open_doors_arm.py demo/twin

The arm's model is the one that the package gymnasium-robotics ships (Apache 2.0, by Vikash Kumar; the package itself is not
imported). For each joint the arm is set down, at any height, as on a lift, where mink's inverse kinematics brings its hand along
the part's whole way and neither arm nor hand is in anything; then joint position control executes the primitive of the joint,
open loop, as far as a person was seen to open the part.
"""

import argparse
import importlib.util
import json
import pathlib
import sys
import tempfile

import mink
import mujoco
import numpy as np

import open_doors as floating

# Where the arm may stand, from the contact: metres out of the face and beside it, and metres of its foot below the contact.
OUT_M = (0.6, 0.45, 0.75, 0.3, 0.9)
BESIDE_M, BELOW_M = (0.0, 0.2, -0.2, 0.4, -0.4, 0.6, -0.6), (0.35, 0.6, 0.1)
# What a place may lack at each pose: metres, rad, rad about the handle's bar (fingers can turn about it), and how far a joint
# may go from one pose to the next, rad.
GOOD_M, GOOD_RAD, PIVOT_RAD, GOOD_JUMP = 0.01, 0.1, 0.7, 0.25
# Poses on the way to the part, and with it.
APPROACH, WAY = 8, 40
# Steps of inverse kinematics to the first pose, and to each of the others.
FIRST_STEPS, STEPS = 120, 12
HOME = np.array([0.0, -0.6, 0.0, -2.2, 0.0, 1.6, 0.785])
ARM = [f"robot:panda0_joint{i}" for i in range(1, 8)]
# N m s/rad of each joint, about critical for the file's motors.
DAMPING = [30.0] * 4 + [8.0] * 3
FINGERS = ["robot:panda0_finger_joint1", "robot:panda0_finger_joint2"]
# What a Franka Hand holds with at most.
GRIP_N = 70.0
# Past the middle: the fingers stop where the handle is.
CLOSED_M = -0.02
PREFIX = "arm/"


def panda():
    """The arm on a base, with its motors, out of the package's parts."""
    found = importlib.util.find_spec("gymnasium_robotics")
    if found is None:
        sys.exit("no Panda: pip install gymnasium-robotics")
    root = pathlib.Path(found.origin).parent / "envs/assets/kitchen_franka/franka_assets"
    assets = (root / "assets.xml").read_text().replace('meshdir="franka_assets/meshes"', f'meshdir="{root / "meshes"}"')
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        (folder / "assets.xml").write_text(assets)
        for name in ("chain.xml", "actuator.xml"):
            (folder / name).write_text((root / name).read_text())
        (folder / "arm.xml").write_text(
            '<mujoco model="panda"><include file="assets.xml"/><worldbody><body name="foot">'
            '<include file="chain.xml"/></body></worldbody><include file="actuator.xml"/></mujoco>'
        )
        spec = mujoco.MjSpec.from_file(str(folder / "arm.xml"))
        for body in spec.bodies:
            # As a real arm's controller carries the arm.
            body.gravcomp = 1
        for joint in spec.joints:
            if joint.name in ARM:
                # The file's damping alone would take all of a motor's torque at 0.9 rad/s.
                damping = DAMPING[ARM.index(joint.name)]
                # Newer releases have three numbers there, of which the first is the linear one.
                joint.damping = damping if np.ndim(joint.damping) == 0 else [damping, 0, 0]
                joint.armature = 0.1
        for actuator in spec.actuators:
            if "gripper" in actuator.name:
                # As strong as a Franka Hand; the file's motors give 3 N on a handle.
                actuator.set_to_position(kp=GRIP_N / 0.01)
                actuator.forcerange = [-GRIP_N, GRIP_N]
                actuator.ctrlrange = [-0.01, 0.04]
        spec.compile()
    return spec


def scene(folder):
    """A twin with the arm in it, on a mocap body: where it stands is said later."""
    spec = mujoco.MjSpec.from_file(str(pathlib.Path(folder) / "scene.xml"))
    for key in list(spec.keys):
        spec.delete(key)
    arm = panda()
    arm.body("foot").mocap = True
    # The twin has no use for the one setting of its own that the arm's file makes.
    arm.nuser_actuator = -1
    spec.worldbody.add_frame().attach_body(arm.body("foot"), PREFIX, "")
    return spec.compile()


def hand_pose(position, quat):
    """The pose of the site between the fingertips: this model's fingers close along its y, so a quarter turn; x is the bar."""
    out = np.zeros(4)
    mujoco.mju_mulQuat(out, np.asarray(quat, float), np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)]))
    return mink.SE3.from_rotation_and_translation(mink.SO3(out), np.asarray(position, float))


class Kinematics:
    """The arm alone, its foot at the origin."""

    def __init__(self):
        self.model = panda().compile()
        self.configuration = mink.Configuration(self.model)
        self.task = mink.FrameTask("end_effector", "site", position_cost=1.0, orientation_cost=[0.05, 0.3, 0.3])
        self.posture = mink.PostureTask(self.model, cost=1e-3)
        self.limits = [mink.ConfigurationLimit(self.model)]
        home = np.zeros(self.model.nq)
        home[:7] = HOME
        self.home = home

    def begin(self, q=None):
        self.configuration.update(self.home if q is None else q)
        self.posture.set_target(self.home)

    def reach(self, target, steps):
        """Moves towards a pose; the errors that are left."""
        self.task.set_target(target)
        for _ in range(steps):
            velocity = mink.solve_ik(
                self.configuration, [self.task, self.posture], 0.1, "daqp", damping=1e-4, limits=self.limits
            )
            self.configuration.integrate_inplace(velocity, 0.1)
        error = self.task.compute_error(self.configuration)
        return np.linalg.norm(error[:3]), np.linalg.norm(error[4:]), abs(error[3])

    def follow(self, targets):
        """Joint positions along poses, and the worst errors of them."""
        self.begin()
        path, worst = [], np.zeros(3)
        for i, target in enumerate(targets):
            error = self.reach(target, STEPS if i else FIRST_STEPS)
            worst = np.maximum(worst, error)
            path.append(self.configuration.q[:7].copy())
        return np.array(path), worst


def wanted_of(primitive):
    """As far as a person was seen to open it: an arm that stands still does not reach around a door that is wide open."""
    limits = primitive["limits"]
    return min(limits["upper"], limits["observed"])


def poses(primitive):
    """Gripper poses to reach: from before the grasp to it, then with the part at equal steps of its opening; and these openings."""
    before, grasp = primitive["pregrasp"], primitive["grasp"]
    steps = np.linspace(0, 1, APPROACH)
    way = [np.array(before["position"]) * (1 - s) + np.array(grasp["position"]) * s for s in steps]
    approach = [(position, grasp["rotation_wxyz"]) for position in way]
    path = primitive["opening"]["path"]
    openings = np.linspace(0, wanted_of(primitive), WAY)
    columns = np.hstack([path["positions"], path["rotations_wxyz"]])
    held = np.array([np.interp(openings, path["openings"], column) for column in columns.T]).T
    return approach + [(row[:3], row[3:] / np.linalg.norm(row[3:])) for row in held], np.r_[np.zeros(APPROACH), openings]


def places(primitive, floor):
    """Base poses to try, the likely ones first: before the face, looking at it, not under the floor."""
    contact, origin = np.array(primitive["contact"]["point"]), np.array(primitive["origin"])
    out = -np.array(primitive["contact"]["approach"])
    out[2] = 0.0
    if np.linalg.norm(out) < 0.5:
        # A lid: from the side of its handle.
        out = np.cross(primitive["axis"], [0, 0, 1.0])
        out *= np.sign(out @ (contact - origin)) or 1.0
    out /= np.linalg.norm(out)
    side = np.array([-out[1], out[0], 0.0])
    yaw = np.arctan2(-out[1], -out[0])
    quat = np.array([np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)])
    for away in OUT_M:
        for beside in BESIDE_M:
            for below in BELOW_M:
                foot = contact + out * away + side * beside - np.array([0, 0, below])
                foot[2] = max(foot[2], floor + 0.005)
                yield foot, quat


def seen_from(base, targets):
    world = mink.SE3.from_rotation_and_translation(mink.SO3(base[1]), base[0])
    return [world.inverse() @ hand_pose(*t) for t in targets]


def place(model, kinematics, primitive):
    """The first place from which all is reached well and the arm is in nothing; else the best one. With the joint positions,
    the worst errors and the number of poses that have the arm in something."""
    arm, best = Arm(model, primitive["joint"]), None
    targets, openings = poses(primitive)
    for base in places(primitive, floor_of(model)):
        path, worst = kinematics.follow(seen_from(base, targets))
        jump = np.abs(np.diff(path, axis=0)).max()
        cost = max([*(worst / [GOOD_M, GOOD_RAD, PIVOT_RAD]), jump / GOOD_JUMP])
        # Out of reach counts as being in something everywhere; the part is open as far as it is at each pose.
        inside = sum(arm.inside(base, q, x) for q, x in zip(path, openings)) if cost <= 1.0 else len(path) + 1
        if best is None or (inside, cost) < best[0]:
            best = (inside, cost), base, path, worst, inside
        if inside == 0:
            break
    return best[1:]


def floor_of(model):
    floor = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, "floor")
    return float(model.geom_pos[floor][2]) if floor >= 0 else -np.inf


class Arm:
    """A scene with the arm in it, and what happened."""

    def __init__(self, model, joint):
        self.model, self.data = model, mujoco.MjData(model)
        self.joint = model.joint(joint)
        self.part = int(model.jnt_bodyid[self.joint.id])
        self.motors = [model.actuator(f"{PREFIX}panda0_joint{i}").id for i in range(1, 8)]
        self.grip = [model.actuator(f"{PREFIX}{n}_gripper_finger_joint").id for n in "rl"]
        self.arm = [model.joint(PREFIX + n).qposadr[0] for n in ARM]
        self.fingers = [model.joint(PREFIX + n).qposadr[0] for n in FINGERS]
        self.own = {b for b in range(model.nbody) if model.body(b).name.startswith(PREFIX)}
        self.tips = {b for b in self.own if model.body(b).name.endswith("finger")}
        self.peak_torque, self.hits = 0.0, {}

    @property
    def opening(self):
        return float(self.data.qpos[self.joint.qposadr[0]])

    def stand(self, base):
        mujoco.mj_resetData(self.model, self.data)
        self.data.mocap_pos[0], self.data.mocap_quat[0] = base

    def inside(self, base, q, opening):
        """Whether the arm, its fingers apart, is in something or in itself."""
        self.stand(base)
        self.data.qpos[self.arm], self.data.qpos[self.joint.qposadr[0]] = q, opening
        mujoco.mj_forward(self.model, self.data)
        for contact in self.data.contact[: self.data.ncon]:
            bodies = {int(self.model.geom_bodyid[g]) for g in contact.geom}
            if contact.dist < -0.002 and bodies & (self.own - self.tips):
                return True
        return False

    def begin(self, base, q, width):
        self.stand(base)
        self.data.qpos[self.arm] = q
        self.data.qpos[self.fingers] = 0.5 * width
        self.command(q)
        self.width(width)
        mujoco.mj_forward(self.model, self.data)

    def command(self, q):
        self.data.ctrl[self.motors] = q

    def width(self, width):
        self.data.ctrl[self.grip] = 0.5 * width

    def along(self, path, secs):
        """Joint targets along a path, linear between its points."""
        steps = max(int(round(secs / self.model.opt.timestep)), 1)
        for i in range(1, steps + 1):
            at = (len(path) - 1) * i / steps
            low = min(int(at), len(path) - 2)
            self.command(path[low] + (path[low + 1] - path[low]) * (at - low))
            self.step()

    def hold(self, secs):
        for _ in range(int(round(secs / self.model.opt.timestep))):
            self.step()

    def step(self):
        mujoco.mj_step(self.model, self.data)
        self.peak_torque = max(self.peak_torque, float(np.abs(self.data.actuator_force[self.motors]).max()))
        wrench = np.zeros(6)
        for i in range(self.data.ncon):
            geoms = self.data.contact[i].geom
            bodies = [int(self.model.geom_bodyid[g]) for g in geoms]
            inside = [b in self.own or b == self.part for b in bodies]
            if all(inside) or not any(inside):
                continue
            mujoco.mj_contactForce(self.model, self.data, i, wrench)
            if wrench[0] >= floating.TOUCH_N:
                names = [self.model.geom(g).name or self.model.body(b).name for g, b in zip(geoms, bodies)]
                key = " - ".join(names if inside[0] else names[::-1])
                self.hits[key] = max(self.hits.get(key, 0.0), float(wrench[0]))


def one(model, kinematics, primitive, system, args):
    """The row of one joint."""
    row = {"joint": primitive["joint"], "label": primitive["label"], "type": primitive["type"]}
    base, path, worst, inside = place(model, kinematics, primitive)
    row.update(base=base[0].tolist(), base_quat=base[1].tolist(), ik_m=float(worst[0]), ik_rad=float(worst[1]), inside=inside)
    arm = Arm(model, primitive["joint"])
    width = min(primitive["contact"]["gripper_opening_m"], floating.WIDEST_M)
    arm.begin(base, path[0], width)
    arm.hold(0.2)
    arm.along(path[:APPROACH], floating.APPROACH_SECS)
    arm.hold(0.3)
    arm.width(CLOSED_M)
    arm.hold(1.0)
    reached = []
    # The part's way as the primitive of the joint goes it, the arm's joints by the opening.
    wanted = wanted_of(primitive)
    openings = np.linspace(0, wanted, WAY)
    for way, start, goal in (("opening", 0.0, wanted), ("closing", wanted, 0.0)):
        dmp = dict(primitive[way]["dmp_joint"], start=[start], goal=[goal])
        secs = dmp["duration_secs"] / args.speed
        asked = floating.rollout(system, dmp, secs / 500, secs)[:, 0]
        arm.along(np.array([np.interp(asked, openings, q) for q in path[APPROACH:].T]).T, secs)
        arm.hold(floating.REST_SECS)
        reached.append(arm.opening)
    opened = reached[0] >= floating.OPENED * wanted
    row.update(wanted=wanted, reached=reached[0], left_at=reached[1], opened=opened)
    row.update(closed=opened and reached[1] <= floating.CLOSED * wanted, peak_torque_nm=arm.peak_torque)
    row["collisions"] = {k: round(v, 1) for k, v in sorted(arm.hits.items(), key=lambda kv: -kv[1])}
    return row


def main():
    parser = argparse.ArgumentParser(description="A Panda opens the joints of a twin in MuJoCo, by its primitives.")
    parser.add_argument("twin", type=pathlib.Path, help="folder with scene.xml and primitives.json")
    parser.add_argument("--speed", type=float, default=0.5, help="of the recorded hand's [default: 0.5]")
    parser.add_argument("--joint", action="append", help="only this joint; may be repeated")
    parser.add_argument("--out", type=pathlib.Path, metavar="FILE", help="the table as JSON")
    args = parser.parse_args()
    file = args.twin / "primitives.json"
    if not file.is_file():
        parser.error(f"{file}: no such file; `paws twin` and `paws export` write it")
    primitives = json.loads(file.read_text())
    model, kinematics, rows = scene(args.twin), Kinematics(), []
    for primitive in primitives["joints"]:
        if args.joint and primitive["joint"] not in args.joint:
            continue
        row = one(model, kinematics, primitive, primitives["dmp"], args)
        rows.append(row)
        unit = (lambda x: f"{np.degrees(x):.0f} deg") if row["type"] == "revolute" else (lambda x: f"{100 * x:.0f} cm")
        hits = ", ".join(f"{k} {v:.0f} N" for k, v in list(row["collisions"].items())[:2]) or "none"
        print(
            f"{row['joint']:12} {row['label']:12} {unit(row['reached'])} of {unit(row['wanted'])}, left at "
            f"{unit(row['left_at'])}; hand to {1000 * row['ik_m']:.0f} mm and {np.degrees(row['ik_rad']):.0f} deg; "
            f"{row['peak_torque_nm']:.0f} N m; collisions: {hits}",
            flush=True,
        )
    opened, closed = sum(r["opened"] for r in rows), sum(r["closed"] for r in rows)
    print(f"\nopened: {opened} of {len(rows)}; and closed again: {closed} of {len(rows)}")
    if args.out:
        report = {"scene": primitives["scene"], "joints": rows, "opened": opened, "closed": closed, "of": len(rows)}
        args.out.write_text(json.dumps(report, indent=2) + "\n")
    return 0 if rows and opened == len(rows) else 1


if __name__ == "__main__":
    sys.exit(main())
