"""Anybody's URDF: python check_a_model.py [MODEL.urdf]"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import paws_twin

# A cabinet with a fault that many loaders pass over: a door without mass.
CABINET = """<robot name="cabinet">
  <link name="body"><inertial><mass value="20"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="door"><visual><origin xyz="0 0.2 0"/><geometry><box size="0.02 0.4 0.6"/></geometry></visual></link>
  <joint name="hinge" type="revolute"><parent link="body"/><child link="door"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="1.6" effort="50" velocity="2"/></joint>
</robot>"""

with tempfile.TemporaryDirectory() as folder:
    model = Path(folder) / "cabinet.urdf"
    model.write_text(CABINET)
    if len(sys.argv) > 1:
        model = Path(sys.argv[1])
    (checked,) = paws_twin.check(model)
    print(f"{model.name}: {'ready' if checked.ready else 'not ready'}")
    for point in checked.points:
        for fault in point.faults:
            print(f"  {point.title}: {fault}")

# A path that a hand went, without any model: which joint does it show?
angle = np.linspace(0.0, 1.2, 40)
path = np.stack([0.4 * np.sin(angle), 0.4 * np.cos(angle), np.full(40, 1.0)], axis=1)
joint = paws_twin.infer_path(path)
print(f"path: {joint.kind}, axis {np.round(joint.axis, 2)}, {joint.range:.2f} rad: {joint.reason}")
