"""House in Python: the program serves it. `SPRINT` names the program."""

import os
import unittest
import warnings

import gymnasium
import numpy
from gymnasium.utils.env_checker import check_env

from sprint_env.house_client import HouseError
from sprint_env.house_env import HouseEnv
from sprint_env.house_server import HouseServer

BATHROOMS = ["--rooms", "bathroom", "--length", "2", "--houses", "4"]


@unittest.skipUnless(os.environ.get("SPRINT"), "SPRINT does not name the program")
class HouseEnvTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.server = HouseServer(BATHROOMS)

    @classmethod
    def tearDownClass(cls) -> None:
        cls.server.close()

    def make(self, **options: object) -> HouseEnv:
        env = HouseEnv(server=self.server, **options)
        self.addCleanup(env.close)
        return env

    def test_gymnasiums_own_checker_has_nothing_to_say(self) -> None:
        env = gymnasium.make(
            "sprint_env.house_env:sprint/House-v0", options=BATHROOMS, size=64, legal=True, render_mode="rgb_array"
        )
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            check_env(env.unwrapped)
        program = env.unwrapped._own.process
        env.close()
        self.assertIsNotNone(program.poll(), "the program goes on without its environment")

    def test_a_seed_is_an_episode_and_turning_once_around_ends_where_it_began(self) -> None:
        env = self.make()
        first, info = env.reset(seed=2)
        self.assertEqual(first["frame"].shape, (128, 128, 3))
        self.assertEqual((info["completed"], info["of"], len(info["subtasks"])), (0, 2, 2))
        kept = first["frame"].copy()
        for _ in range(4):
            seen, reward, terminated, truncated, info = env.step(env.action("RotateLeft"))
            self.assertEqual((reward, terminated, truncated, info["possible"]), (0.0, False, False, True))
        numpy.testing.assert_array_equal(seen["frame"], kept)
        numpy.testing.assert_array_equal(first["frame"], kept, "an earlier observation changed")
        other, _ = env.reset(seed=3)
        self.assertNotEqual(other["mission"], "")
        self.assertFalse(numpy.array_equal(other["frame"], kept))

    def test_what_is_told_possible_is_possible_and_all_else_is_not(self) -> None:
        env = self.make(legal=True)
        tried = 0
        for seed in range(4):
            _, info = env.reset(seed=seed)
            # Fewer steps than any of these tasks has.
            for _ in range(12):
                legal, name = info["legal"], env.snapshot()
                self.assertTrue(legal[:5, 0].all() and not legal[:5, 1:].any())
                for action in zip(*legal[5:].nonzero()):
                    *_, after = env.step([action[0] + 5, action[1]])
                    self.assertTrue(after["possible"])
                    env.restore(name)
                    tried += 1
                sample = env.action_space.sample()
                *_, after = env.step(sample)
                if sample[0] >= 5 and not legal[sample[0], sample[1]]:
                    self.assertFalse(after["possible"])
                _, info = env.restore(name)
                _, _, _, _, info = env.step(env.action("RotateLeft" if tried % 2 else "MoveAhead"))
        self.assertGreater(tried, 0)

    def test_who_does_nothing_gets_nothing_and_the_horizon_truncates(self) -> None:
        env = self.make()
        env.reset(seed=0)
        rewards, over = [], False
        while not over:
            _, reward, terminated, truncated, info = env.step(env.action("LookUp"))
            rewards.append(reward)
            over = terminated or truncated
        self.assertEqual((sum(rewards), terminated, truncated, info["is_success"]), (0.0, False, True, False))
        with self.assertRaisesRegex(HouseError, "the episode is over"):
            env.step(env.action("LookUp"))

    def test_environments_side_by_side_see_what_they_see_alone(self) -> None:
        vector = gymnasium.vector.SyncVectorEnv([lambda: HouseEnv(server=self.server) for _ in range(3)])
        self.addCleanup(vector.close)
        seen, _ = vector.reset(seed=[0, 1, 2])
        self.assertEqual(seen["frame"].shape, (3, 128, 128, 3))
        self.assertEqual(len(set(seen["mission"])), len(seen["mission"]))
        seen, rewards, *_ = vector.step(numpy.array([[1, 0], [1, 0], [1, 0]]))
        alone = self.make()
        alone.reset(seed=1)
        numpy.testing.assert_array_equal(alone.step([1, 0])[0]["frame"], seen["frame"][1])
        self.assertEqual(rewards.tolist(), [0.0, 0.0, 0.0])

    def test_processes_side_by_side_share_the_server(self) -> None:
        socket = self.server.socket
        vector = gymnasium.vector.AsyncVectorEnv([lambda: HouseEnv(server=socket) for _ in range(2)])
        self.addCleanup(vector.close)
        vector.reset(seed=[0, 1])
        seen, *_ = vector.step(numpy.array([[1, 0], [2, 0]]))
        self.assertEqual(seen["frame"].shape, (2, 128, 128, 3))

    def test_what_the_program_says_when_it_cannot_serve_is_told(self) -> None:
        with self.assertRaisesRegex(RuntimeError, "no-such-file"):
            HouseServer(["--tasks", "no-such-file.json"])


if __name__ == "__main__":
    unittest.main()
