#!/usr/bin/env python3
"""A gripper opens and closes every joint of a twin in MuJoCo, by its primitives.

    pip install mujoco numpy
    paws demo --out demo
    python examples/python/open_doors.py demo/twin
    python examples/python/open_doors.py demo/twin --truth KITCHEN      # the same motions on another kitchen's scene.xml

It reads `scene.xml` and `primitives.json` of a folder that `paws twin` or `paws export` wrote: the gripper goes to the pregrasp, to
the grasp, feels for the front behind the handle, closes, follows the Dynamic Movement Primitive, and back. It does not look.
docs/primitives.md explains every key.

The gripper floats: a spring and a damper pull it to a mocap body, as an arm under impedance control would, with no more than
`FORCE_N` and `TORQUE_NM`. Where a primitive is wrong, the wrist gives way, and the table says by how much.
"""

import argparse
import json
import pathlib
import sys

import mujoco
import numpy as np

# An arm like a Panda under Cartesian impedance control: N/m, N m/rad, and what its wrist gives at most.
STIFFNESS, TURN_STIFFNESS = 2000.0, 40.0
FORCE_N, TORQUE_NM = 80.0, 10.0
# kg and kg m^2 of the hand; a Franka Hand weighs 0.73 kg. The inertia has that of a wrist in it.
MASS, INERTIA = 0.8, 0.01
# Half of what a Franka Hand holds with.
GRIP_N = 35.0
WIDEST_M = 0.08
# The hand goes on beyond the grasp until it feels the front, at most so far, at this speed; then a little back. m, m/s, N.
FEEL_M, FEEL_M_PER_S, FEEL_N, BACK_M = 0.045, 0.05, 8.0, 0.006
# Seconds: from pregrasp to grasp, to close the fingers, and to come to rest at the end of a motion.
APPROACH_SECS, CLOSE_SECS, REST_SECS = 1.0, 0.5, 0.5
# A true joint belongs to a primitive if its handle is no farther than this, metres.
MATCH_M = 0.25
# What counts as done, as a share of the range: opened, and closed again.
OPENED, CLOSED = 0.9, 0.1
# Two solids that brush each other with less do not count as a collision, N.
TOUCH_N = 1.0
GRIPPER = "paws_gripper"


# -- The gripper ------------------------------------------------------------------------------------------------------------


def add_gripper(spec):
    """A palm with two coupled fingers on a free joint, its origin between the fingertips: z approaches, x closes."""
    target = spec.worldbody.add_body(name=f"{GRIPPER}_target", mocap=True)
    target.add_site(name=f"{GRIPPER}_target", size=[0.006] * 3, rgba=[1, 0.3, 0.2, 1])
    hand = spec.worldbody.add_body(name=GRIPPER, gravcomp=1)
    hand.add_freejoint(name=GRIPPER)
    hand.explicitinertial = True
    hand.mass, hand.inertia, hand.ipos = MASS, [INERTIA] * 3, [0, 0, -0.05]
    hand.add_geom(
        name=f"{GRIPPER}_palm",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[0.05, 0.02, 0.02],
        pos=[0, 0, -0.065],
        rgba=[0.9, 0.9, 0.92, 1],
    )
    for name, side in (("left", -1.0), ("right", 1.0)):
        finger = hand.add_body(name=f"{GRIPPER}_{name}", gravcomp=1)
        finger.add_joint(
            name=f"{GRIPPER}_{name}",
            type=mujoco.mjtJoint.mjJNT_SLIDE,
            axis=[side, 0, 0],
            range=[0, 0.5 * WIDEST_M],
            limited=mujoco.mjtLimited.mjLIMITED_TRUE,
            damping=40,
            armature=0.05,
        )
        # Fingertips reach 15 mm beyond the middle of a handle: between bar and front is room for twice as much.
        finger.add_geom(
            name=f"{GRIPPER}_{name}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[0.005, 0.010, 0.030],
            pos=[side * 0.005, 0, -0.015],
            mass=0.05,
            friction=[1.0, 0.01, 0.001],
            condim=4,
            rgba=[0.3, 0.3, 0.32, 1],
        )
        actuator = spec.add_actuator(
            name=f"{GRIPPER}_{name}",
            target=f"{GRIPPER}_{name}",
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            forcerange=[-GRIP_N, GRIP_N],
            forcelimited=mujoco.mjtLimited.mjLIMITED_TRUE,
        )
        actuator.set_to_position(kp=3000.0)
    both = spec.add_equality(
        name=GRIPPER, type=mujoco.mjtEq.mjEQ_JOINT, name1=f"{GRIPPER}_left", name2=f"{GRIPPER}_right"
    )
    both.objtype = mujoco.mjtObj.mjOBJ_JOINT
    both.data[:5] = [0, 1, 0, 0, 0]


# -- Primitives -------------------------------------------------------------------------------------------------------------


def rollout(system, dmp, dt, secs):
    """Coordinates every `dt` seconds of a primitive stretched to `secs`, from its start to its goal."""
    centers, widths = np.array(system["centers"]), np.array(system["widths"])
    weights = np.array(dmp["weights"])
    start, goal = np.array(dmp["start"]), np.array(dmp["goal"])
    y, z = start.copy(), np.zeros_like(start)
    step, out = dt / secs, [start.copy()]
    for i in range(int(round(secs / dt))):
        x = np.exp(-system["phase_decay"] * i * step)
        psi = np.exp(-widths * (x - centers) ** 2)
        f = weights @ psi * x / psi.sum()
        if dmp["forcing"] == "scaled":
            push = f * (goal - start)
        else:
            push = system["alpha"] * system["beta"] * (f - (goal - start) * x)
        z = z + step * (system["alpha"] * (system["beta"] * (goal - y) - z) + push)
        y = y + step * z
        out.append(y.copy())
    return np.array(out)


def turned(vector, quat):
    """A quaternion (w first) turned by a rotation vector in world axes."""
    angle = np.linalg.norm(vector)
    turn, out = np.array([1.0, 0, 0, 0]), np.zeros(4)
    if angle > 1e-12:
        mujoco.mju_axisAngle2Quat(turn, vector / angle, angle)
    mujoco.mju_mulQuat(out, turn, np.asarray(quat, float))
    return out


def held(primitive, point, opening):
    """Where opening a joint takes a point of its closed part."""
    axis, origin = np.array(primitive["axis"]), np.array(primitive["origin"])
    if primitive["type"] == "prismatic":
        return point + axis * opening
    quat, moved = np.zeros(4), np.zeros(3)
    mujoco.mju_axisAngle2Quat(quat, axis, opening)
    mujoco.mju_rotVecQuat(moved, point - origin, quat)
    return origin + moved


def smooth(share):
    """A minimum jerk from 0 to 1."""
    return share**3 * (10 - 15 * share + 6 * share**2)


def straight(a, b, dt, secs):
    """Poses from one gripper pose to another of the same orientation."""
    a, b = np.array(a["position"]), np.array(b["position"])
    count = max(int(round(secs / dt)), 1)
    return [a + (b - a) * smooth(i / count) for i in range(1, count + 1)]


# -- Simulation -------------------------------------------------------------------------------------------------------------


class Run:
    """One joint under one gripper, and what happened to them."""

    def __init__(self, model, joint):
        self.model, self.data = model, mujoco.MjData(model)
        self.joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, joint)
        self.part = model.jnt_bodyid[self.joint]
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, GRIPPER)
        self.body, self.own = body, {body, body + 1, body + 2}
        self.free = model.jnt_qposadr[mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, GRIPPER)]
        self.speed = model.jnt_dofadr[mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, GRIPPER)]
        self.peak_force = self.peak_torque = self.peak_off = 0.0
        self.force = np.zeros(3)
        self.hits = {}

    @property
    def opening(self):
        return float(self.data.qpos[self.model.jnt_qposadr[self.joint]])

    def begin(self, pose, width):
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[self.free : self.free + 7] = [*pose["position"], *pose["rotation_wxyz"]]
        for name in ("left", "right"):
            joint = self.model.joint(f"{GRIPPER}_{name}")
            self.data.qpos[joint.qposadr[0]] = 0.5 * width
        self.fingers(width)
        self.to(pose["position"], pose["rotation_wxyz"])
        self.last = self.data.mocap_pos[0].copy(), self.data.mocap_quat[0].copy()
        mujoco.mj_forward(self.model, self.data)

    def fingers(self, width):
        for name in ("left", "right"):
            self.data.actuator(f"{GRIPPER}_{name}").ctrl[0] = 0.5 * width

    def to(self, position, quat):
        self.data.mocap_pos[0], self.data.mocap_quat[0] = position, quat

    def step(self):
        """The wrist's spring and damper, limited; then a step, and what touched what in it."""
        d = self.data
        off = d.mocap_pos[0] - d.qpos[self.free : self.free + 3]
        turn = np.zeros(3)
        mujoco.mju_subQuat(turn, d.mocap_quat[0], d.qpos[self.free + 3 : self.free + 7])
        # Against the target's own speed. Differences of quaternions and a free joint's turn are in the body's own axes.
        pull = np.zeros(3)
        mujoco.mju_subQuat(pull, d.mocap_quat[0], self.last[1])
        ahead = np.concatenate([d.mocap_pos[0] - self.last[0], pull]) / self.model.opt.timestep
        self.last = d.mocap_pos[0].copy(), d.mocap_quat[0].copy()
        slow = ahead - d.qvel[self.speed : self.speed + 6]
        force = STIFFNESS * off + 2.0 * np.sqrt(STIFFNESS * MASS) * slow[:3]
        torque = TURN_STIFFNESS * turn + 2.0 * np.sqrt(TURN_STIFFNESS * INERTIA) * slow[3:]
        force *= min(1.0, FORCE_N / max(np.linalg.norm(force), 1e-9))
        torque *= min(1.0, TORQUE_NM / max(np.linalg.norm(torque), 1e-9))
        # What the world pushes with at rest is what the spring pulls against.
        self.force = -force
        d.qfrc_applied[self.speed : self.speed + 3] = force
        d.qfrc_applied[self.speed + 3 : self.speed + 6] = torque
        mujoco.mj_step(self.model, d)
        self.peak_force = max(self.peak_force, float(np.linalg.norm(force)))
        self.peak_torque = max(self.peak_torque, float(np.linalg.norm(torque)))
        self.peak_off = max(self.peak_off, float(np.linalg.norm(off)))
        self.collide()

    def collide(self):
        """Contacts of the gripper with what is not its part, and of the part with what is not the gripper."""
        d, m = self.data, self.model
        wrench = np.zeros(6)
        for i in range(d.ncon):
            pair = d.contact[i].geom
            bodies = [int(m.geom_bodyid[g]) for g in pair]
            inside = [b in self.own or b == self.part for b in bodies]
            if all(inside) or not any(inside):
                continue
            mujoco.mj_contactForce(m, d, i, wrench)
            if wrench[0] < TOUCH_N:
                continue
            names = [m.geom(g).name or m.body(b).name for g, b in zip(pair, bodies)]
            key = " - ".join(names if inside[0] else names[::-1])
            self.hits[key] = max(self.hits.get(key, 0.0), float(wrench[0]))

    def hold(self, secs):
        for _ in range(int(round(secs / self.model.opt.timestep))):
            self.step()

    def feel(self, position, approach):
        """Goes on along the approach until the front pushes back; where the gripper then is asked to be."""
        step = FEEL_M_PER_S * self.model.opt.timestep
        gone, quat = 0.0, self.data.mocap_quat[0].copy()
        while gone < FEEL_M and -self.force @ approach < FEEL_N:
            gone += step
            self.to(position + approach * gone, quat)
            self.step()
        # Nothing felt: there is no front in reach, and the handle is taken to be where it was thought.
        kept = max(gone - BACK_M, 0.0) if gone < FEEL_M else 0.0
        for x in straight({"position": approach * gone}, {"position": approach * kept}, self.model.opt.timestep, 0.5):
            self.to(position + x, quat)
            self.step()
        self.hold(0.1)
        return position + approach * kept

    def follow(self, system, primitive, way, speed, grasp=None):
        """A motion by the primitive of the pose; the start's orientation is the first of its path. Of a part that is held
        elsewhere (`grasp`) the places are those to which the primitive of the joint takes it, about the primitive's axis."""
        motion, dt = primitive[way], self.model.opt.timestep
        secs = motion["dmp_pose"]["duration_secs"] / speed
        first = motion["path"]["rotations_wxyz"][0]
        poses = rollout(system, motion["dmp_pose"], dt, secs)
        if grasp is not None:
            openings = rollout(system, motion["dmp_joint"], dt, secs)[:, 0]
            poses[:, :3] = [held(primitive, grasp, x) for x in openings]
        for y in poses:
            self.to(y[:3], turned(y[3:], first))
            self.step()
        self.hold(REST_SECS)


def execute(model, name, primitive, system, speed, shift=None):
    """Opens and closes one joint: pregrasp, grasp, open, close, let go, back. `shift` is how far the handle is from where the
    primitive has it, if somebody looked."""
    run = Run(model, name)
    dt = model.opt.timestep
    width = min(primitive["contact"]["gripper_opening_m"], WIDEST_M)
    looked = shift is not None
    off = shift if looked else np.zeros(3)
    before, grasp = (dict(p, position=np.array(p["position"]) + off) for p in (primitive["pregrasp"], primitive["grasp"]))
    run.begin(before, width)
    run.hold(0.1)
    for position in straight(before, grasp, dt, APPROACH_SECS):
        run.to(position, grasp["rotation_wxyz"])
        run.step()
    run.hold(0.2)
    held_at = run.feel(grasp["position"], np.array(primitive["contact"]["approach"]))
    # Past the middle: the fingers stop where the handle is.
    run.fingers(-0.03)
    run.hold(CLOSE_SECS)
    reached = []
    for way in ("opening", "closing"):
        run.follow(system, primitive, way, speed, held_at if looked or not np.array_equal(held_at, grasp["position"]) else None)
        reached.append(run.opening)
    run.fingers(width)
    run.hold(CLOSE_SECS)
    for position in straight(dict(grasp, position=held_at), before, dt, APPROACH_SECS):
        run.to(position, grasp["rotation_wxyz"])
        run.step()
    return run, *reached


# -- The table --------------------------------------------------------------------------------------------------------------


def load(folder):
    """A scene with the gripper in it."""
    path = pathlib.Path(folder)
    spec = mujoco.MjSpec.from_file(str(path / "scene.xml" if path.is_dir() else path))
    # Poses of keyframes have no gripper.
    for key in list(spec.keys):
        spec.delete(key)
    add_gripper(spec)
    return spec.compile()


def handles(model):
    """Where the handle of each joint is, closed: sites called `<joint>_handle`."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    found = {}
    for i in range(model.njnt):
        name = model.joint(i).name
        site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, f"{name}_handle")
        if site >= 0:
            found[name] = data.site_xpos[site].copy()
    return found


def moved_by_a_person(folder):
    """How far each joint of a true kitchen was moved in its recording, where its ground_truth.json says so."""
    path = pathlib.Path(folder) / "ground_truth.json"
    moved = {}
    if path.is_file():
        for clip in json.loads(path.read_text()).get("clips", []):
            if clip.get("x"):
                moved[clip["joint"]] = max(moved.get(clip["joint"], 0.0), *clip["x"])
    return moved


def nearest(places, point):
    """The joint whose handle is nearest to a point, and how far it is."""
    distances = {name: float(np.linalg.norm(p - point)) for name, p in places.items()}
    name = min(distances, key=distances.get, default=None)
    return name, distances.get(name, np.inf)


def kind_of(model, name):
    joint = model.joint(name)
    return "revolute" if joint.type[0] == mujoco.mjtJoint.mjJNT_HINGE else "prismatic"


def one(model, primitive, system, args, truth, moved):
    """The row of one joint."""
    name, off = primitive["joint"], 0.0
    row = {"joint": name, "label": primitive["label"], "type": primitive["type"]}
    if truth is not None:
        name, off = nearest(truth, np.array(primitive["contact"]["point"]))
        row.update(true_joint=name, contact_off_m=off)
        if name is None or off > MATCH_M:
            row.update(opened=False, closed=False, why="no true handle is near the contact")
            return row
        row["true_type"] = kind_of(model, name)
    if primitive["contact"]["hold"] != "handle":
        row.update(opened=False, closed=False, why="no handle: nothing to take hold of")
        return row
    upper = float(model.joint(name).range[1])
    # What is asked for: on the twin the whole range, on the truth what a person was seen to move.
    wanted = primitive["limits"]["upper"]
    if truth is not None:
        wanted = min(moved.get(name, primitive["limits"]["observed"]), upper)
    shift = truth[name] - np.array(primitive["contact"]["point"]) if args.look else None
    run, opened, closed = execute(model, name, primitive, system, args.speed, shift)
    row.update(
        wanted=wanted,
        reached=opened,
        share=opened / wanted if wanted > 0 else 0.0,
        opened=opened >= OPENED * wanted,
        closed=opened >= OPENED * wanted and closed <= CLOSED * wanted,
        left_at=closed,
        peak_force_n=run.peak_force,
        peak_torque_nm=run.peak_torque,
        peak_off_m=run.peak_off,
        collisions={k: round(v, 1) for k, v in sorted(run.hits.items(), key=lambda kv: -kv[1])},
    )
    return row


def text(rows):
    header = ["joint", "furniture", "wanted", "reached", "opened", "closed", "force", "torque", "wrist off", "collisions"]
    lines = [header]
    for r in rows:
        if "why" in r:
            lines.append([r["joint"], r["label"], "-", "-", "no", "no", "-", "-", "-", r["why"]])
            continue
        amount = (lambda x: f"{np.degrees(x):.0f} deg") if r["type"] == "revolute" else (lambda x: f"{100 * x:.0f} cm")
        hits = ", ".join(f"{k} {v:.0f} N" for k, v in list(r["collisions"].items())[:2]) or "none"
        if r.get("true_type", r["type"]) != r["type"]:
            amount = lambda x: f"{x:.2f}"
        lines.append(
            [r["joint"], r["label"], amount(r["wanted"]), amount(r["reached"])]
            + ["yes" if r[k] else "no" for k in ("opened", "closed")]
            + [f"{r['peak_force_n']:.0f} N", f"{r['peak_torque_nm']:.1f} N m", f"{100 * r['peak_off_m']:.1f} cm", hits]
        )
    widths = [max(len(line[i]) for line in lines) for i in range(len(header))]
    return "\n".join("  ".join(c.ljust(w) for c, w in zip(line, widths)).rstrip() for line in lines)


def main():
    parser = argparse.ArgumentParser(description="A gripper opens every joint of a twin in MuJoCo, by its primitives.")
    parser.add_argument("twin", type=pathlib.Path, help="folder with scene.xml and primitives.json")
    parser.add_argument("--truth", type=pathlib.Path, metavar="KITCHEN", help="execute on this folder's scene.xml instead")
    parser.add_argument("--look", action="store_true", help="with --truth: as if the gripper saw the handle before it takes hold")
    parser.add_argument("--speed", type=float, default=1.0, help="how much faster than the recorded hand [default: 1]")
    parser.add_argument("--joint", action="append", help="only this joint; may be repeated")
    parser.add_argument("--out", type=pathlib.Path, metavar="FILE", help="the table as JSON")
    args = parser.parse_args()
    if args.look and not args.truth:
        parser.error("--look needs --truth: on its own twin the handle is where the primitive says")
    if not args.speed > 0:
        parser.error("--speed must be positive")
    for path in (args.twin / "primitives.json", (args.truth or args.twin) / "scene.xml"):
        if not path.is_file():
            parser.error(f"{path}: no such file; `paws twin` and `paws export` write it")
    primitives = json.loads((args.twin / "primitives.json").read_text())
    if primitives.get("schema") != "paws-primitives/1":
        parser.error(f"{args.twin / 'primitives.json'}: schema {primitives.get('schema')!r} is not paws-primitives/1")
    model = load(args.truth or args.twin)
    truth = handles(model) if args.truth else None
    moved = moved_by_a_person(args.truth) if args.truth else {}
    chosen = [p for p in primitives["joints"] if not args.joint or p["joint"] in args.joint]
    rows = [one(model, p, primitives["dmp"], args, truth, moved) for p in chosen]
    opened, closed = sum(r["opened"] for r in rows), sum(r["closed"] for r in rows)
    print(text(rows))
    print(f"\nopened: {opened} of {len(rows)}; and closed again: {closed} of {len(rows)}")
    if args.out:
        report = {"scene": primitives["scene"], "on": "truth" if args.truth else "twin", "joints": rows}
        report.update(opened=opened, closed=closed, of=len(rows))
        args.out.write_text(json.dumps(report, indent=2) + "\n")
    return 0 if opened == len(rows) and rows else 1


if __name__ == "__main__":
    sys.exit(main())
