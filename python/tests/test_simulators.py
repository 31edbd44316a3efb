"""MuJoCo and the Gymnasium environment."""

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco")
gymnasium = pytest.importorskip("gymnasium")


@pytest.fixture
def env(twin):
    import paws_twin.gym  # noqa: F401

    with gymnasium.make("paws_twin/OpenDrawerOrDoor-v0", twin=twin) as made:
        yield made


def test_the_twin_is_a_model_and_a_part_of_another_scene(twin):
    assert twin.mujoco().njnt == 2
    scene = mujoco.MjSpec()
    scene.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    scene.attach(twin.mjspec(), prefix="kitchen/", frame=scene.worldbody.add_frame())
    assert scene.compile().joint("kitchen/joint_1").range[1] == pytest.approx(twin.joint("joint_1").upper)


def test_the_environment_keeps_the_rules_of_gymnasium(env):
    from gymnasium.utils.env_checker import check_env

    check_env(env.unwrapped, skip_render_check=True)


@pytest.mark.parametrize("joint", ["joint_0", "joint_1"])
@pytest.mark.parametrize("task", ["open", "close"])
def test_a_push_along_the_joint_wins_and_one_against_it_does_not(env, joint, task):
    for way, wins in ((1, True), (-1, False)):
        observation, info = env.reset(seed=0, options={"joint": joint, "task": task})
        assert info["done"] == 0 and not info["success"]
        towards = way * (1 if task == "open" else -1)
        rewards, over = [], False
        while not over:
            along = env.unwrapped.opening_direction()
            speed = towards * float(observation[6:9] @ along)
            wanted = 0.4 if info["done"] < 1 else 0.0
            action = towards * np.clip(0.3 * (wanted - speed), -1, 1) * along
            observation, reward, terminated, truncated, info = env.step(action.astype(np.float32))
            rewards.append(reward)
            over = terminated or truncated
        assert info["success"] == terminated == wins
        # ManiSkill's scale: all at success, at most three fifths and two fifths before.
        assert rewards[-1] == (1.0 if wins else pytest.approx(0.2, abs=0.02))


def test_a_seed_draws_the_same_episode(env):
    drawn = [env.reset(seed=5)[1] for _ in range(2)]
    assert drawn[0] == drawn[1]
    assert len({(i["joint"], i["task"]) for i in (env.reset(seed=s)[1] for s in range(20))}) == 4
