"""Verdicts, rivals and the truth: python read_verdicts.py [RECORDING]"""

import sys

import numpy as np

import paws_twin

if len(sys.argv) > 1:
    recording = paws_twin.Recording(sys.argv[1])
else:
    recording = paws_twin.synth(seed=3, tier="clean", width=160, parts=2)
twin = paws_twin.twin(recording, no_textures=True)

for verdict in twin.validation.joints:
    # How much likelier the joint is than the best other explanation of its hands, as a logarithm.
    margin = "nothing to compare" if verdict.margin_nats is None else f"{np.exp(min(verdict.margin_nats, 20)):.0f} : 1"
    print(f"\n{verdict.id}: {verdict.verdict} ({margin}): {verdict.reason}")
    for rival in sorted(verdict.raw["rivals"], key=lambda r: r["distance_m"])[:3]:
        print(f"  rival: {rival['name']}, hands {100 * rival['distance_m']:.1f} cm off")
    for clip in verdict.clips:
        apart = np.linalg.norm(clip.hand - clip.handle, axis=1)
        print(f"  {clip.clip}: {clip.action}, hand and handle {100 * apart.mean():.1f} cm apart, {clip.peak_force_n:.0f} N")

if (recording.path / "ground_truth.json").is_file():
    report = paws_twin.evaluate(twin, recording)
    print(f"\n{report.answered} of {report.clips} clips answered")
    for rule, shares in report.rules.items():
        print(f"  {rule}: type {shares['m']:.2f}, and axis {shares['ma']:.2f}, and hinge {shares['mao']:.2f}")
