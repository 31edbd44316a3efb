"""A recording to a twin: python make_a_twin.py [RECORDING [DIR]]"""

import sys

import paws_twin

# 1. A recording: a folder of yours, or a kitchen with a known answer that is rendered now.
if len(sys.argv) > 1:
    recording = paws_twin.Recording(sys.argv[1])
else:
    recording = paws_twin.synth(seed=3, tier="clean", width=160, parts=2)
print(f"{recording.name}: {len(recording.times)} frames, {len(recording.clips)} clips")

# 2. Its twin. Ctrl-C ends it at the next step and leaves nothing half-done.
steps = []


def progress(step, done, total):
    if step not in steps:
        steps.append(step)
        print(f"  {step} ...")


twin = paws_twin.twin(recording, out=sys.argv[2] if len(sys.argv) > 2 else None, progress=progress)

# 3. What it is.
for joint in twin.joints:
    verdict = twin.validation.joint(joint.id)
    unit = "rad" if joint.kind == "revolute" else "m"
    print(f"{joint.id}: {joint.label}, {joint.kind}, opens {joint.upper:.2f} {unit}: {verdict.verdict}")
for note in twin.notes:
    print(f"note: {note}")
for name in ("scene.urdf", "scene.xml", "kitchen.xml", "scene.usda", "scene.glb"):
    print(twin.file(name))
