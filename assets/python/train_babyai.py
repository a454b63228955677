"""Trains a small policy on BabyAI-GoToRedBall by what BabyAI's own bot does there, exports it, and evaluates it.

    python train_babyai.py --out red_ball.onnx

Needs the packages torch, onnx, onnxruntime and minigrid. `sprint eval --env gym:BabyAI-GoToRedBall-v0 --policy
onnx:red_ball.onnx` comes to the same success on the same seeds, 0 to 99.
"""

import argparse
import contextlib
import json
import sys

import numpy
import torch
from export_policy import export
from minigrid.utils.baby_ai_bot import BabyAIBot
from sprint_env.make_gym import make
from torch import nn

LEVEL = "BabyAI-GoToRedBall-v0"
ACTIONS = ["left", "right", "forward", "pickup", "drop", "toggle", "done"]
SPEC = {
    "frames": {"height": 56, "width": 56},
    "instruction": {"tokens": {"vocabulary": ["go", "to", "the", "red", "ball"], "length": 8}},
    "actions": ACTIONS,
}
#: Seeds that training does not touch.
FIRST_SEED_OF_TRAINING = 1_000_000


class RedBallPolicy(nn.Module):
    """Three convolutions of which each tile of the view is one place in the end, and words added up."""

    def __init__(self):
        super().__init__()
        self.view = nn.Sequential(
            nn.Conv2d(3, 16, 4, stride=4), nn.ReLU(), nn.Conv2d(16, 32, 2, stride=2), nn.ReLU(), nn.Flatten()
        )
        self.words = nn.Embedding(len(SPEC["instruction"]["tokens"]["vocabulary"]) + 2, 16)
        self.head = nn.Sequential(nn.Linear(32 * 49 + 16, 128), nn.ReLU(), nn.Linear(128, len(ACTIONS)))

    def forward(self, frames, tokens):
        """The logits of actions."""
        return self.head(torch.cat([self.view(frames), self.words(tokens).sum(1)], 1))


def tokens(mission):
    """The mission as the policy reads it: 0 pads, 1 is an unknown word."""
    told = SPEC["instruction"]["tokens"]
    words = "".join(c if c.isalnum() else " " for c in mission.lower()).split()
    known = [told["vocabulary"].index(word) + 2 if word in told["vocabulary"] else 1 for word in words]
    return (known + [0] * told["length"])[: told["length"]]


def picture(observation):
    """Planes of the frame, from 0 to 1."""
    frame = observation.frame
    rgb = numpy.frombuffer(frame.rgb, dtype=numpy.uint8).reshape(frame.height, frame.width, 3)
    return torch.from_numpy(rgb.copy()).permute(2, 0, 1).float() / 255


def demonstrations(environment, episodes):
    """What the bot saw, was told, and did."""
    seen, told, done = [], [], []
    for seed in range(FIRST_SEED_OF_TRAINING, FIRST_SEED_OF_TRAINING + episodes):
        observation = environment.reset(seed, None)
        bot, action = BabyAIBot(environment.level), None
        while not (observation.terminated or observation.truncated):
            action = int(bot.replan(action))
            seen.append((picture(observation) * 255).byte())
            told.append(tokens(observation.mission))
            done.append(action)
            observation = environment.step(ACTIONS[action], None)
    return torch.stack(seen), torch.tensor(told), torch.tensor(done)


def train(data, steps, batch=128):
    """Behaviour cloning."""
    torch.manual_seed(0)
    seen, told, done = data
    policy = RedBallPolicy()
    optimiser = torch.optim.Adam(policy.parameters(), lr=1e-3)
    for step in range(1, steps + 1):
        chosen = torch.randint(0, len(done), (batch,))
        loss = nn.functional.cross_entropy(policy(seen[chosen].float() / 255, told[chosen]), done[chosen])
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        if step % 500 == 0:
            print(f"step {step}: loss {loss.item():.3f}", flush=True)
    return policy.eval()


def evaluate(policy, environment, seeds):
    """The seeds on which the policy comes to the ball, by the likeliest action."""
    solved = []
    for seed in seeds:
        observation = environment.reset(seed, None)
        while not (observation.terminated or observation.truncated):
            with torch.no_grad():
                logits = policy(picture(observation)[None], torch.tensor([tokens(observation.mission)]))
            observation = environment.step(ACTIONS[int(logits.argmax())], None)
        if observation.success:
            solved.append(seed)
    return solved


def main():
    """Trains, exports, evaluates; the last line is a JSON object."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", default="red_ball.onnx")
    parser.add_argument("--episodes", type=int, default=2000, help="of the bot")
    parser.add_argument("--steps", type=int, default=5000, help="of training")
    parser.add_argument("--seeds", type=int, default=100, help="to evaluate on, from 0")
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    environment = make(LEVEL, 8, {})
    # BabyAI says on standard output which of its attempts at a level came to nothing.
    with contextlib.redirect_stdout(sys.stderr):
        policy = train(demonstrations(environment, chosen.episodes), chosen.steps)
        off = export(policy, SPEC, chosen.out)
        solved = evaluate(policy, environment, range(chosen.seeds))
    print(json.dumps({"out": chosen.out, "off": off, "success": len(solved) / chosen.seeds, "solved": solved}))


if __name__ == "__main__":
    main()
