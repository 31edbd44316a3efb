"""A Gymnasium environment: open or close one joint of a twin by a force at its handle.

    import gymnasium, paws_twin.gym
    env = gymnasium.make("paws_twin/OpenDrawerOrDoor-v0", twin="twin")

Reward, success and length of an episode are those of ManiSkill's OpenCabinetDrawer and OpenCabinetDoor, with the motion
counted from where the task starts, so that closing is opening seen backwards:

- success: the joint has gone through `min_open_frac` (0.75) of its range, and the part stands still: its centre of mass moves
  by at most 0.1 m/s, and it turns by at most 1 rad/s;
- dense reward: 5 at success; else a share for reaching, and for the motion `2 * done`, or 3 where it is far enough. `done` is
  the motion over the motion that is asked for. The hand of this environment is always at the handle: its share for reaching is
  1, and 2 as soon as the part moves (by a thousandth of what is asked for). `reward_mode="normalized_dense"` divides by 5,
  `"sparse"` is 1 at success and 0 else;
- observation, 9 numbers: position, velocity and target of the joint (`qpos`, `qvel`, `target_qpos`; rad or m), the handle's
  position (m, world) and velocity (m/s). ManiSkill's robot is not there, nor are its joints and the pose of its hand;
- action, 3 numbers in [-1, 1]: the force at the handle in world axes, times `max_force`.

An episode ends at success, or, cut off, after 100 steps.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ._call import AnyPath
from .twins import Twin, needed

gymnasium: Any = needed("gymnasium", "gym")
mujoco: Any = needed("mujoco", "gym")

#: ManiSkill's bounds on a part that stands still.
STILL_M_PER_S = 0.1
STILL_RAD_PER_S = 1.0
#: As long as ManiSkill's episodes.
MAX_STEPS = 100
#: Share of the wanted motion at which a part counts as moved, ManiSkill's.
MOVED_SHARE = 1e-3


class OpenDrawerOrDoor(gymnasium.Env):  # type: ignore[misc]
    """Opens or closes one joint of a twin: see the head of the module.

    `joint` and `task` ("open" or "close") are drawn anew at every reset where they are None; `reset(options={"joint": ...,
    "task": ...})` says them for one episode. `max_force` is in newtons: the default is about the strongest pull of a recorded
    hand. `control_hz` is how often an action is taken.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 20}

    def __init__(
        self,
        twin: AnyPath,
        joint: str | None = None,
        task: str | None = None,
        *,
        max_force: float = 80.0,
        control_hz: float = 20.0,
        min_open_frac: float = 0.75,
        reward_mode: str = "normalized_dense",
        render_mode: str | None = None,
        size: tuple[int, int] = (480, 360),
    ):
        self.twin = twin if isinstance(twin, Twin) else Twin(twin)
        if not self.twin.joints:
            raise ValueError(f"{self.twin.path}: the twin has no joint")
        if reward_mode not in ("normalized_dense", "dense", "sparse"):
            raise ValueError(f'reward_mode {reward_mode!r}: give "normalized_dense", "dense" or "sparse"')
        self.model = self.twin.mujoco()
        self.data = mujoco.MjData(self.model)
        self.fixed = {"joint": joint, "task": task}
        self.max_force = float(max_force)
        self.min_open_frac = float(min_open_frac)
        self.reward_mode = reward_mode
        self.substeps = max(1, round(1.0 / (control_hz * self.model.opt.timestep)))
        self.render_mode = render_mode
        self.size = size
        self._renderer: Any = None
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (9,), np.float32)
        self._choose(self.twin.joints[0].id, "open")

    def _choose(self, joint: str, task: str) -> None:
        if task not in ("open", "close"):
            raise ValueError(f'task {task!r}: give "open" or "close"')
        self.part = self.twin.joint(joint)
        self.task = task
        number = self.model.joint(joint).id
        self._qpos = int(self.model.jnt_qposadr[number])
        self._dof = int(self.model.jnt_dofadr[number])
        self._body = int(self.model.jnt_bodyid[number])
        self._site = self.model.site(f"{joint}_handle").id
        low, high = self.model.jnt_range[number]
        self._start, self._end = (low, high) if task == "open" else (high, low)
        self.target_qpos = self._start + (self._end - self._start) * self.min_open_frac

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        super().reset(seed=seed)
        asked = {**self.fixed, **(options or {})}
        names = [j.id for j in self.twin.joints]
        # Both are drawn each time, so that a seed draws the same joint whether or not the task is said.
        drawn = (names[self.np_random.integers(len(names))], ("open", "close")[self.np_random.integers(2)])
        self._choose(asked.get("joint") or drawn[0], asked.get("task") or drawn[1])
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[self._qpos] = self._start
        mujoco.mj_forward(self.model, self.data)
        return self._observation(), self._info()

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        force = self.max_force * np.clip(np.asarray(action, dtype=float), -1.0, 1.0)
        for _ in range(self.substeps):
            self.data.qfrc_applied[:] = 0.0
            handle = self.data.site_xpos[self._site]
            mujoco.mj_applyFT(
                self.model, self.data, force, np.zeros(3), handle, self._body, self.data.qfrc_applied
            )
            mujoco.mj_step(self.model, self.data)
        self.data.qfrc_applied[:] = 0.0
        mujoco.mj_forward(self.model, self.data)
        info = self._info()
        return self._observation(), self._reward(info), bool(info["success"]), False, info

    def opening_direction(self) -> np.ndarray:
        """The unit vector (world) along which the handle goes as the joint opens: for scripts, not for learners."""
        jacobian = np.zeros((3, self.model.nv))
        mujoco.mj_jacSite(self.model, self.data, jacobian, None, self._site)
        along = jacobian[:, self._dof]
        return along / max(float(np.linalg.norm(along)), 1e-9)

    def _observation(self) -> np.ndarray:
        jacobian = np.zeros((3, self.model.nv))
        mujoco.mj_jacSite(self.model, self.data, jacobian, None, self._site)
        joint = [self.data.qpos[self._qpos], self.data.qvel[self._dof], self.target_qpos]
        return np.concatenate([joint, self.data.site_xpos[self._site], jacobian @ self.data.qvel]).astype(np.float32)

    def _info(self) -> dict[str, Any]:
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_BODY, self._body, velocity, 0)
        done = float((self.data.qpos[self._qpos] - self._start) / (self.target_qpos - self._start))
        enough = done >= 1.0
        still = np.linalg.norm(velocity[:3]) <= STILL_RAD_PER_S and np.linalg.norm(velocity[3:]) <= STILL_M_PER_S
        return {
            "joint": self.part.id,
            "task": self.task,
            "done": done,
            "open_enough": enough,
            "success": bool(enough and still),
        }

    def _reward(self, info: dict[str, Any]) -> float:
        if self.reward_mode == "sparse":
            return float(info["success"])
        reaching = 2.0 if info["done"] > MOVED_SHARE else 1.0
        reward = 5.0 if info["success"] else reaching + (3.0 if info["open_enough"] else 2.0 * info["done"])
        return reward / 5.0 if self.reward_mode == "normalized_dense" else reward

    def render(self) -> np.ndarray | None:
        if self.render_mode != "rgb_array":
            return None
        if self._renderer is None:
            self._renderer = mujoco.Renderer(self.model, height=self.size[1], width=self.size[0])
        camera = mujoco.MjvCamera()
        camera.lookat[:] = self.part.handle
        # From the side to which the part comes out, and from above.
        camera.distance, camera.elevation = 2.0, -25.0
        away = self.part.handle - self.part.bounds.center
        camera.azimuth = float(np.degrees(np.arctan2(-away[1], -away[0])))
        self._renderer.update_scene(self.data, camera)
        return self._renderer.render()

    def close(self) -> None:
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


gymnasium.register(id="paws_twin/OpenDrawerOrDoor-v0", entry_point=OpenDrawerOrDoor, max_episode_steps=MAX_STEPS)
