"""The twin in Isaac Lab: ./isaaclab.sh -p isaac_lab_scene.py TWIN (needs Isaac Sim; never run by our tests)"""

import sys

try:
    from isaaclab.app import AppLauncher
except ImportError as error:
    sys.exit(f"Isaac Lab is not installed: {error}")

# The app has to run before anything else of Isaac is imported.
app = AppLauncher(headless=True).app

import isaaclab.sim as sim_utils  # noqa: E402
from isaaclab.actuators import ImplicitActuatorCfg  # noqa: E402
from isaaclab.assets import Articulation, ArticulationCfg  # noqa: E402

import paws_twin  # noqa: E402

twin = paws_twin.Twin(sys.argv[1])
simulation = sim_utils.SimulationContext(sim_utils.SimulationCfg(dt=1 / 240))
simulation.set_camera_view([2.5, 2.5, 2.0], [0.0, 0.0, 0.8])
# Nothing drives the joints: they are opened by whatever touches them. Damping and friction are in the file.
passive = ImplicitActuatorCfg(joint_names_expr=[".*"], stiffness=0.0, damping=None)
config = ArticulationCfg(
    prim_path="/World/Kitchen",
    spawn=sim_utils.UsdFileCfg(usd_path=str(twin.file("scene.usda"))),
    actuators={"passive": passive},
)
kitchen = Articulation(config)
simulation.reset()
print(kitchen.joint_names)
app.close()
