"""BabyAI's own bot as a policy that is told pictures and missions alone."""

import unittest

import numpy

from sprint_env.babyai_bot import BabyAIBotPolicy
from sprint_env.environment import CannotDo, Observation
from sprint_env.make_gym import make

LEVEL = "BabyAI-GoToLocal-v0"


def pixels(seen: Observation) -> numpy.ndarray:
    return numpy.frombuffer(seen.frame.rgb, numpy.uint8).reshape(seen.frame.height, seen.frame.width, 3)


class BabyAIBotTest(unittest.TestCase):
    def test_it_solves_every_level_that_it_expects(self) -> None:
        bot = BabyAIBotPolicy(LEVEL, range(40))
        environment = make(LEVEL, 8, {})
        for seed in range(40):
            seen = environment.reset(seed, None)
            bot.begin()
            while not seen.done:
                seen = environment.step(bot(pixels(seen), seen.mission), None)
            self.assertTrue(seen.success, f"seed {seed}")

    def test_it_finds_its_way_from_where_others_led_it(self) -> None:
        bot = BabyAIBotPolicy(LEVEL, range(5))
        environment = make(LEVEL, 8, {})
        seen = environment.reset(3, None)
        bot(pixels(seen), seen.mission)
        for _ in range(2):
            seen = environment.step("left", None)
            advice = bot(pixels(seen), seen.mission, "left")
        while not seen.done:
            seen = environment.step(advice, None)
            advice = None if seen.done else bot(pixels(seen), seen.mission)
        self.assertTrue(seen.success)

    def test_an_unexpected_level_is_refused(self) -> None:
        bot = BabyAIBotPolicy(LEVEL, range(5))
        seen = make(LEVEL, 8, {}).reset(99, None)
        with self.assertRaisesRegex(CannotDo, "no level of BabyAI-GoToLocal-v0"):
            bot(pixels(seen), seen.mission)


if __name__ == "__main__":
    unittest.main()
