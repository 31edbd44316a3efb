"""Loads scene.xml and scene.urdf of each twin in MuJoCo and drives every joint.

One line a file: loads, rests closed, opens under a pull at the handle, closes again, nothing penetrates on the way.
Exit code 1 and the reason on the first point that does not hold.
"""

import json
import math
import os
import sys

import mujoco
import numpy as np

REST_SECS = 2.0
MOVE_SECS = 2.0


def fail(path, message):
    print(f"{path}: {message}")
    sys.exit(1)


def parts(folder):
    with open(os.path.join(folder, "twin.json"), encoding="utf-8") as f:
        twin = json.load(f)
    return [f["part"] for f in twin["furniture"]], twin


def step(model, data, seconds, force=None):
    for _ in range(int(seconds / model.opt.timestep)):
        data.qfrc_applied[:] = 0
        if force is not None:
            force()
        mujoco.mj_step(model, data)
        if not np.all(np.isfinite(data.qpos)):
            return False
    return True


def check(path, folder):
    model = mujoco.MjModel.from_xml_path(path)
    data = mujoco.MjData(model)
    moving, twin = parts(folder)
    n = len(moving)
    if model.njnt != n:
        fail(path, f"{model.njnt} joints, the twin has {n}")
    if n == 0:
        print(f"{path} ok (no joint)")
        return
    # World, bases and parts: nothing may be fused away. A URDF keeps its own `world` link.
    if model.nbody < 2 * n + 1:
        fail(path, f"{model.nbody} bodies, at least {2 * n + 1} are needed")
    volume = sum(8 * np.prod(s["shape"]["half"]) for f in twin["furniture"] for s in f["carcass"] + f["part"]["solids"])
    if abs(model.body_mass.sum() - twin["density_kg_per_m3"] * volume) > 1e-3 * model.body_mass.sum():
        fail(path, f"mass {model.body_mass.sum():.3f} kg is not density x volume")
    for i, part in enumerate(moving):
        j = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, part["id"])
        low, high = model.jnt_range[j]
        if not model.jnt_limited[j] or abs(low) > 1e-9 or abs(high - part["joint"]["upper"]) > 1e-6:
            fail(path, f"{part['id']}: limits {low} {high}")
        dof = model.jnt_dofadr[j]
        if abs(model.dof_damping[dof] - part["joint"]["damping"]) > 1e-9:
            fail(path, f"{part['id']}: damping is lost")
        if abs(model.dof_frictionloss[dof] - part["joint"]["friction"]) > 1e-9:
            fail(path, f"{part['id']}: friction is lost")

    # Rest: closed doors stay closed.
    # A stop is a spring of the joint's time constant (solreflimit; a URDF cannot set it): the weight of a lid rests on it.
    mujoco.mj_resetData(model, data)
    mujoco.mj_forward(model, data)
    give = np.abs(data.qfrc_bias) / model.dof_M0 * model.jnt_solref[:, 0] ** 2
    if not step(model, data, REST_SECS):
        fail(path, "the state is not finite at rest")
    drift = np.abs(data.qpos) - give
    if drift.max() > 1e-3:
        fail(path, f"joint {int(drift.argmax())} drifts to {data.qpos[int(drift.argmax())]:.4f} at rest")
    if data.ncon:
        fail(path, f"{data.ncon} contacts at rest")

    # Sweep: the worst penetration over each joint's range, the others closed.
    worst = 0.0
    mujoco.mj_resetData(model, data)
    for part in moving:
        j = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, part["id"])
        q = model.jnt_qposadr[j]
        for share in np.linspace(0, 1, 51):
            data.qpos[:] = 0
            data.qpos[q] = share * part["joint"]["upper"]
            mujoco.mj_forward(model, data)
            for c in range(data.ncon):
                worst = min(worst, data.contact[c].dist)

    # A hand takes each handle to the open end and back: a spring of 800 N/m between hand and handle, 150 N at most.
    for part in moving:
        joint = part["joint"]
        phi = joint["articulation"]
        name = part["id"]
        j = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
        body = model.jnt_bodyid[j]
        q, dof, upper = model.jnt_qposadr[j], model.jnt_dofadr[j], joint["upper"]
        axis, origin = np.array(phi["axis"]), np.array(phi["origin"])
        handle = np.array(part["handle"]) - origin
        turns = phi["kind"] == "revolute"
        lever = np.linalg.norm(np.cross(axis, handle)) if turns else 1.0
        stiffness = 800.0
        damping = 2.0 * math.sqrt(stiffness * model.body_mass[body])

        def hand(wanted, speed):
            p = data.xpos[body] + data.xmat[body].reshape(3, 3) @ handle
            along = np.cross(axis, p - origin) if turns else axis
            along = along / np.linalg.norm(along)
            force = stiffness * lever * (wanted - data.qpos[q]) + damping * lever * (speed - data.qvel[dof])
            # A person carries what the part weighs.
            force += data.qfrc_bias[dof] / max(lever, 0.05)
            mujoco.mj_applyFT(model, data, np.clip(force, -150, 150) * along, np.zeros(3), p, body, data.qfrc_applied)

        def move(start, end):
            begin = data.time
            def drive():
                share = min((data.time - begin) / MOVE_SECS, 1.0)
                hand(start + share * (end - start), (end - start) / MOVE_SECS if share < 1 else 0.0)
            return step(model, data, MOVE_SECS + 1.0, drive)

        mujoco.mj_resetData(model, data)
        others = [k for k in range(model.nq) if k != q]
        if not move(0.0, upper):
            fail(path, f"{name}: not finite while opening")
        opened = data.qpos[q]
        if abs(opened - upper) > 0.05 * upper:
            fail(path, f"{name}: opens to {opened:.3f} of {upper:.3f}")
        if not move(upper, 0.0):
            fail(path, f"{name}: not finite while closing")
        # The hand lets go.
        step(model, data, 1.0)
        if abs(data.qpos[q]) > 5e-3:
            fail(path, f"{name}: closes to {data.qpos[q]:.4f}")
        if others and np.abs(data.qpos[others]).max() > 0.02:
            fail(path, f"{name}: moves another joint by {np.abs(data.qpos[others]).max():.3f}")
        if any(w.number for w in data.warning):
            fail(path, f"{name}: MuJoCo warned")
    if worst < -5e-3:
        fail(path, f"penetration of {-1000 * worst:.1f} mm in the sweep")
    print(f"{path} ok {n} joints, {model.body_mass.sum():.1f} kg, worst penetration {-1000 * worst:.2f} mm")


if __name__ == "__main__":
    for folder in sys.argv[1:]:
        for file in ("scene.xml", "scene.urdf"):
            check(os.path.join(folder, file), folder)
