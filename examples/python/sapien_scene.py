"""The twin in SAPIEN, and so in ManiSkill: python sapien_scene.py TWIN (pip install sapien; Vulkan, to show colours, where there is some)"""

import sys
import xml.etree.ElementTree as xml
from pathlib import Path

import paws_twin

try:
    import sapien
except ImportError as error:
    sys.exit(f"sapien is not installed: {error}")

twin = paws_twin.Twin(sys.argv[1])
urdf = twin.file("scene.urdf")
systems = [sapien.physx.PhysxCpuSystem()]
try:
    systems.append(sapien.render.RenderSystem())
except RuntimeError as error:
    print(f"{error}: physics alone, without anything to see")
    tree = xml.parse(urdf)
    for link in tree.getroot().iter("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
    urdf = Path("scene_collision.urdf")
    tree.write(urdf)
scene = sapien.Scene(systems)
scene.set_timestep(1 / 240)
loader = scene.create_urdf_loader()
loader.fix_root_link = True
kitchen = loader.load(str(urdf))
names = [joint.name for joint in kitchen.get_active_joints()]
# Every joint pulled open with a force of its own, 20 N or 5 Nm.
forces = [5.0 if twin.joint(name).kind == "revolute" else 20.0 for name in names]
for _ in range(480):
    kitchen.set_qf(forces)
    scene.step()
for name, position in zip(names, kitchen.get_qpos()):
    print(f"{name}: opened {position:.2f} of {twin.joint(name).upper:.2f}")
