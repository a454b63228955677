"""Levels of Minigrid and BabyAI."""

import unittest

import gymnasium
from minigrid.utils.baby_ai_bot import BabyAIBot
from minigrid.wrappers import RGBImgPartialObsWrapper

from sprint_env.environment import Observation
from sprint_env.make_gym import make
from sprint_env.minigrid_environment import MinigridEnvironment


def level(name: str) -> MinigridEnvironment:
    environment = make(name, 8, {})
    assert isinstance(environment, MinigridEnvironment)
    return environment


def play_with_bot(environment: MinigridEnvironment, seed: int) -> list[Observation]:
    seen = [environment.reset(seed, None)]
    bot = BabyAIBot(environment.level)
    while not seen[-1].done:
        seen.append(environment.step(environment.action_names[bot.replan()], None))
    return seen


class MinigridTest(unittest.TestCase):
    def test_frames_are_those_of_minigrids_own_wrapper(self) -> None:
        own = RGBImgPartialObsWrapper(gymnasium.make("BabyAI-GoToLocal-v0"), tile_size=8)
        environment = level("BabyAI-GoToLocal-v0")
        expected, _ = own.reset(seed=3)
        seen = environment.reset(3, None)
        for action in [0, 2, 2, 1, 2]:
            self.assertEqual(seen.frame.rgb, expected["image"].tobytes())
            self.assertEqual(seen.mission, expected["mission"])
            expected = own.step(action)[0]
            seen = environment.step(environment.action_names[action], None)

    def test_the_bots_success_is_told_with_every_subtask(self) -> None:
        environment = level("BabyAI-Synth-v0")
        last = play_with_bot(environment, 4)[-1]
        self.assertTrue(last.success and last.terminated)
        self.assertTrue(all(subtask.done for subtask in last.subtasks))

    def test_a_mission_of_several_parts_is_followed_part_by_part(self) -> None:
        environment = level("BabyAI-SynthSeq-v0")
        seen = next(
            seen for seed in range(50) if len((seen := play_with_bot(environment, seed))[0].subtasks) > 1
        )
        counts = [sum(subtask.done for subtask in observation.subtasks) for observation in seen]
        self.assertEqual((counts[0], counts[-1]), (0, len(seen[-1].subtasks)))
        self.assertEqual(counts, sorted(counts))
        self.assertIn(1, counts)
        for subtask in seen[0].subtasks:
            self.assertIn(subtask.text, seen[0].mission)

    def test_running_out_of_steps_is_no_success(self) -> None:
        environment = level("BabyAI-GoToObj-v0")
        seen = environment.reset(1, None)
        while not seen.done:
            seen = environment.step("left", None)
        self.assertEqual((seen.success, seen.truncated, seen.terminated), (False, True, False))

    def test_things_in_view_lie_in_the_frame_where_they_are_drawn(self) -> None:
        environment = level("BabyAI-GoToLocal-v0")
        seen = environment.reset(1, None)
        self.assertTrue(seen.things)
        for thing in seen.things:
            x0, y0, x1, y1 = thing.box
            self.assertTrue(0 <= x0 < x1 <= seen.frame.width and 0 <= y0 < y1 <= seen.frame.height)
            pixels = {
                seen.frame.rgb[at : at + 3]
                for y in range(y0, y1)
                for at in range(3 * (y * seen.frame.width + x0), 3 * (y * seen.frame.width + x1), 3)
            }
            self.assertGreater(len(pixels), 2, f"{thing.name} is not drawn in its box")

    def test_restored_it_goes_on_as_it_did_the_first_time(self) -> None:
        environment = level("BabyAI-GoToLocal-v0")
        seen = play_with_bot(environment, 7)
        again = environment.reset(7, None)
        self.assertEqual(again, seen[0])
        state = environment.snapshot()
        bot = BabyAIBot(environment.level)
        actions = []
        for observation in seen[1:]:
            actions.append(environment.action_names[bot.replan()])
            self.assertEqual(environment.step(actions[-1], None), observation)
        for _ in range(2):
            self.assertEqual(environment.restore(state), seen[0])
            self.assertEqual([environment.step(action, None) for action in actions], seen[1:])


class GymnasiumTest(unittest.TestCase):
    def test_an_environment_without_pictures_of_its_own_is_rendered(self) -> None:
        environment = make("CartPole-v1", 8, {})
        told = environment.capabilities()
        self.assertEqual([action.name for action in told.actions], ["0", "1"])
        seen = environment.reset(0, None)
        self.assertEqual((seen.frame.width, seen.frame.height), told.frame)
        self.assertEqual(environment.step("1", None).reward, 1.0)
        environment.close()

    def test_possible_actions_come_from_the_mask_that_the_environment_tells(self) -> None:
        environment = make("Taxi-v4", 8, {})
        seen = environment.reset(0, None)
        self.assertEqual(len(seen.legal), 6)
        self.assertIn(False, seen.legal)
        environment.close()


if __name__ == "__main__":
    unittest.main()
