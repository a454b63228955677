"""TextWorld's games, generated and read from files."""

import tempfile
import unittest
from pathlib import Path

import textworld

from sprint_env.environment import CannotDo
from sprint_env.textworld_environment import Games, GameSize, TextWorldEnvironment
from tests.served import Served


class TextWorldTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.folder = tempfile.TemporaryDirectory()
        cls.file = str(Path(cls.folder.name) / "larva.z8")
        options = textworld.GameOptions()
        options.nb_rooms, options.nb_objects, options.quest_length = 3, 5, 3
        options.seeds, options.path = 5, cls.file
        cls.walkthrough = textworld.make(options)[1].metadata["walkthrough"]

    @classmethod
    def tearDownClass(cls) -> None:
        cls.folder.cleanup()

    def environment(self, steps: int = 100) -> TextWorldEnvironment:
        environment = TextWorldEnvironment(Games([self.file], GameSize()), steps)
        self.addCleanup(environment.close)
        return environment

    def test_the_walkthrough_leads_to_success_through_what_is_told_possible(self) -> None:
        environment = self.environment()
        seen = environment.reset(0, None)
        self.assertIn("=", seen.text.splitlines()[0], "the room's name comes first, no banner")
        self.assertTrue(seen.mission)
        self.assertEqual((seen.success, seen.done), (None, False))
        rewards = []
        for command in self.walkthrough:
            self.assertIn(command, seen.legal[0])
            seen = environment.step("command", command)
            rewards.append(seen.reward)
        self.assertEqual((seen.success, seen.terminated, sum(rewards)), (True, True, 1.0))
        self.assertTrue(all(subtask.done for subtask in seen.subtasks))

    def test_a_state_is_gone_back_to_as_often_as_wanted(self) -> None:
        environment = self.environment()
        environment.reset(0, None)
        first = environment.step("command", self.walkthrough[0])
        state = environment.snapshot()
        ends = []
        for _ in range(2):
            for command in self.walkthrough[1:]:
                ends.append(environment.step("command", command))
            again = environment.restore(state)
            self.assertEqual((again.text, again.legal), (first.text, first.legal))
        self.assertTrue(ends[-1].success)
        self.assertEqual(ends[: len(ends) // 2], ends[len(ends) // 2 :])

    def test_running_out_of_steps_is_no_success(self) -> None:
        environment = self.environment(steps=2)
        environment.reset(0, None)
        environment.step("command", "look")
        seen = environment.step("command", "dance with the moon")
        self.assertEqual((seen.success, seen.truncated, seen.terminated), (False, True, False))

    def test_a_game_is_generated_for_each_seed_and_served(self) -> None:
        with Served("textworld", "--rooms", "2", "--objects", "3", "--quest", "2") as served:
            told = served.ask("capabilities")["data"]
            self.assertEqual((told["arguments"], told["frame"]), ({"command": None}, None))
            first = served.see("reset", seed=1)
            command = first["observation"]["legal"][0][0]
            after = served.see("step", action="command", argument=command)
            self.assertEqual(after["reward"], 0.0)
            self.assertEqual(served.see("reset", seed=1), first)

    def test_a_game_that_is_not_there_is_named(self) -> None:
        with self.assertRaisesRegex(CannotDo, "nothing.z8"):
            Games(["nothing.z8"], GameSize())


if __name__ == "__main__":
    unittest.main()
