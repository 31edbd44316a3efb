"""Open and close each joint in a Gymnasium environment: python gym_random_agent.py [TWIN]"""

import sys

import gymnasium

import paws_twin
import paws_twin.gym

if len(sys.argv) > 1:
    twin = paws_twin.Twin(sys.argv[1])
else:
    twin = paws_twin.twin(paws_twin.synth(seed=3, tier="clean", width=160, parts=2), no_textures=True)
env = gymnasium.make("paws_twin/OpenDrawerOrDoor-v0", twin=twin)
env.action_space.seed(0)


def random_agent(observation, info):
    return env.action_space.sample()


def pulls_along(observation, info):
    """Pulls along the joint as a careful hand: faster where it is slow, not at all where it is there."""
    towards = 1 if info["task"] == "open" else -1
    speed = towards * float(observation[6:9] @ env.unwrapped.opening_direction())
    wanted = 0.4 if info["done"] < 1.0 else 0.0
    return towards * max(-1.0, min(1.0, 0.3 * (wanted - speed))) * env.unwrapped.opening_direction()


for agent in (random_agent, pulls_along):
    won = []
    for joint in twin.joints:
        for task in ("open", "close"):
            observation, info = env.reset(seed=7, options={"joint": joint.id, "task": task})
            total, over = 0.0, False
            while not over:
                observation, reward, terminated, truncated, info = env.step(agent(observation, info))
                total += reward
                over = terminated or truncated
            won.append(info["success"])
            print(f"{agent.__name__}: {task} {joint.id}: {'done' if info['success'] else 'not done'}, reward {total:.1f}")
    print(f"{agent.__name__}: {sum(won)} of {len(won)}")
    if agent is pulls_along:
        assert all(won), "who pulls along the joint should open and close all"
env.close()
