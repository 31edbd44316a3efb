"""The twin as an arena of robosuite: python robosuite_scene.py TWIN (pip install robosuite)"""

import sys

import paws_twin

try:
    import robosuite  # noqa: F401
    from robosuite.models.arenas import Arena
    from robosuite.models import MujocoWorldBase
    from robosuite.models.robots import Panda
except ImportError as error:
    sys.exit(f"robosuite is not installed: {error}")

twin = paws_twin.Twin(sys.argv[1])

# scene.xml holds bodies, materials and a floor in one file, as an arena of robosuite does.
arena = Arena(str(twin.file("scene.xml")))
robot = Panda()
robot.set_base_xpos([0, 0, 0])
world = MujocoWorldBase()
world.merge(arena)
world.merge(robot)
model = world.get_model(mode="mujoco")
print(f"{model.njnt} joints, of the kitchen: {[joint.id for joint in twin.joints]}")
