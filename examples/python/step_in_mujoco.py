"""The twin in MuJoCo: python step_in_mujoco.py [TWIN]"""

import sys

import mujoco
import numpy as np

import paws_twin

if len(sys.argv) > 1:
    twin = paws_twin.Twin(sys.argv[1])
else:
    twin = paws_twin.twin(paws_twin.synth(seed=3, tier="clean", width=160, parts=2), no_textures=True)

# 1. Alone: with a floor, a light, and keyframes "closed" and "open".
model = twin.mujoco()
data = mujoco.MjData(model)
mujoco.mj_resetDataKeyframe(model, data, model.key("closed").id)
joint = twin.joints[0]
number = model.joint(joint.id).id
dof = model.jnt_dofadr[number]
handle = model.site(f"{joint.id}_handle").id
while data.time < 2.0:
    # 15 N at the handle, along the way on which it opens.
    mujoco.mj_forward(model, data)
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, jacobian, None, handle)
    way = jacobian[:, dof] / np.linalg.norm(jacobian[:, dof])
    data.qfrc_applied[:] = 0
    body = model.jnt_bodyid[number]
    mujoco.mj_applyFT(model, data, 15.0 * way, np.zeros(3), data.site_xpos[handle], body, data.qfrc_applied)
    mujoco.mj_step(model, data)
opened = float(data.qpos[model.jnt_qposadr[number]])
print(f"{joint.id}: opened {opened:.2f} of {joint.upper:.2f} after {data.time:.1f} s")
assert opened > 0.5 * joint.upper, "it should have opened"

# 2. In a scene of one's own: the kitchen beside a ball.
scene = mujoco.MjSpec()
# As the kitchen was made for; the scene it is attached to decides.
scene.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
ball = scene.worldbody.add_body(name="ball", pos=[0, 0, 1])
ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.05, 0, 0], density=400)
ball.add_freejoint()
scene.attach(twin.mjspec(), prefix="kitchen/", frame=scene.worldbody.add_frame())
together = scene.compile()
print(f"together: {together.nbody} bodies, joints {[together.joint(i).name for i in range(together.njnt)]}")
