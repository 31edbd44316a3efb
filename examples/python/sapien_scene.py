"""The twin in SAPIEN, and so in ManiSkill: python sapien_scene.py TWIN (pip install sapien; needs Vulkan, to load colours, too)"""

import sys

import paws_twin

try:
    import sapien
except ImportError as error:
    sys.exit(f"sapien is not installed: {error}")

twin = paws_twin.Twin(sys.argv[1])
scene = sapien.Scene()
scene.set_timestep(1 / 240)
scene.set_ambient_light([0.6, 0.6, 0.6])
loader = scene.create_urdf_loader()
loader.fix_root_link = True
kitchen = loader.load(str(twin.file("scene.urdf")))
names = [joint.name for joint in kitchen.get_active_joints()]
# Every joint pulled open with a force of its own, 20 N or 5 Nm.
forces = [5.0 if twin.joint(name).kind == "revolute" else 20.0 for name in names]
for _ in range(480):
    kitchen.set_qf(forces)
    scene.step()
for name, position in zip(names, kitchen.get_qpos()):
    print(f"{name}: opened {position:.2f} of {twin.joint(name).upper:.2f}")
