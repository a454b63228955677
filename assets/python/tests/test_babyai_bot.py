"""BabyAI's own bot as a policy server is told of levels."""

import unittest

from sprint_env.babyai_bot import BabyAIBotPolicy
from sprint_env.environment import CannotDo
from sprint_env.make_gym import make

LEVEL = "BabyAI-GoToLocal-v0"


class Episode:
    """An episode as the program plays it: what the bot gave as its state comes back."""

    def __init__(self, bot: BabyAIBotPolicy, seed: int):
        self.bot = bot
        self.environment = make(LEVEL, 8, {})
        self.seen = self.environment.reset(seed, None)
        self.step, self.state, self.last = 0, None, None
        bot.begin({"task": {"environment": f"gym:{LEVEL}", "environment_seed": seed, "seed": 0, "step": 0}})

    def ask(self) -> str:
        answer = self.bot.act({"step": self.step, "state": self.state, "last_action": self.last})
        self.state = answer["state"]
        return answer["action"]

    def take(self, action: str) -> None:
        self.seen = self.environment.step(action, None)
        self.step, self.last = self.step + 1, action


class BabyAIBotTest(unittest.TestCase):
    def test_it_solves_every_level(self) -> None:
        bot = BabyAIBotPolicy()
        for seed in range(40):
            episode = Episode(bot, seed)
            while not episode.seen.done:
                episode.take(episode.ask())
            self.assertTrue(episode.seen.success, f"seed {seed}")

    def test_it_finds_its_way_from_where_others_led_it(self) -> None:
        episode = Episode(BabyAIBotPolicy(), 3)
        for _ in range(2):
            episode.ask()
            episode.take("left")
        while not episode.seen.done:
            episode.take(episode.ask())
        self.assertTrue(episode.seen.success)

    def test_going_back_gives_the_same_advice_again(self) -> None:
        episode = Episode(BabyAIBotPolicy(), 5)
        advice, carried = [], [(episode.step, episode.state, episode.last)]
        for _ in range(3):
            advice.append(episode.ask())
            self.assertEqual(episode.ask(), advice[-1], "asked twice it says the same")
            episode.take(advice[-1])
            carried.append((episode.step, episode.state, episode.last))
        episode.step, episode.state, episode.last = carried[1]
        self.assertEqual(episode.ask(), advice[1])

    def test_what_it_cannot_play_is_refused(self) -> None:
        bot = BabyAIBotPolicy()
        with self.assertRaisesRegex(CannotDo, "no level of BabyAI"):
            bot.begin({"task": {"environment": "gym:CartPole-v1", "environment_seed": 1}})
        episode = Episode(bot, 1)
        episode.step = 2
        with self.assertRaisesRegex(CannotDo, "from its start"):
            episode.ask()


if __name__ == "__main__":
    unittest.main()
