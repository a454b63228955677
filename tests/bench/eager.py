#!/usr/bin/env python3
"""The update of `l-bc` and `sprint` in eager PyTorch, in the presets' own size, to compare `cargo bench --bench training` with.

`python3 tests/bench/eager.py [l-bc] [sprint] [--threads N]` with torch 2.11: milliseconds an update, the median of 30 and the least.
"""

import statistics
import sys
import time
import tomllib
from pathlib import Path

import torch
from torch import nn
from torch.nn import functional as F

PRESET = tomllib.loads((Path(__file__).parents[2] / "assets/presets/sprint.toml").read_text())
ACTIONS, CLASSES, SIDE = 12, 82, 7
WARM, STEPS = 3, 30


class Film(nn.Module):
    def __init__(self, width, channels):
        super().__init__()
        self.scale, self.shift = nn.Linear(width, channels), nn.Linear(width, channels)
        for layer in (self.scale, self.shift):
            nn.init.zeros_(layer.weight)
            nn.init.zeros_(layer.bias)

    def forward(self, x, told):
        return x * (1 + self.scale(told)[..., None, None]) + self.shift(told)[..., None, None]


class Trunk(nn.Module):
    def __init__(self, width, channels, halved, told):
        super().__init__()
        self.convs, self.norms, self.films = nn.ModuleList(), nn.ModuleList(), nn.ModuleList()
        for i, to in enumerate(channels):
            kernel = 1 if i == 0 else 3
            stride = 2 if halved and i == 1 else 1
            self.convs.append(nn.Conv2d(width, to, kernel, stride, padding=kernel // 2, bias=False))
            self.norms.append(nn.BatchNorm2d(to))
            self.films.append(Film(told, to))
            width = to
        self.width = width * (SIDE + 1 >> 1 if halved else SIDE) ** 2

    def forward(self, x, told):
        for conv, norm, film in zip(self.convs, self.norms, self.films):
            x = F.relu(film(norm(conv(x)), told))
        return torch.cat([x.flatten(1), told], 1)


def dense(width, hidden, dropout, out):
    layers = []
    for to in hidden:
        layers += [nn.Linear(width, to), nn.ReLU(), nn.Dropout(dropout)]
        width = to
    return nn.Sequential(*layers, nn.Linear(width, out))


class Policy(nn.Module):
    def __init__(self, features):
        super().__init__()
        spec = PRESET["policy"]
        self.trunk = Trunk(features, spec["channels"], spec["halved"], spec["embedding"])
        width = self.trunk.width + spec["embedding"]
        self.heads = dense(width, spec["hidden"], spec["dropout"], ACTIONS + CLASSES)

    def forward(self, seen, told):
        return self.heads(self.trunk(seen, told)).split([ACTIONS, CLASSES], 1)


class Critic(nn.Module):
    def __init__(self, features):
        super().__init__()
        spec, told = PRESET["critic"], PRESET["policy"]["embedding"]
        self.trunk = Trunk(features, spec["channels"], spec["halved"], told)
        width = self.trunk.width + told
        chosen = spec["action_embedding"] + spec["object_embedding"]
        self.actions = nn.ModuleList(nn.Embedding(ACTIONS, spec["action_embedding"]) for _ in range(2))
        self.objects = nn.ModuleList(nn.Embedding(CLASSES, spec["object_embedding"]) for _ in range(2))
        self.q = nn.ModuleList(dense(width + chosen, spec["hidden"], spec["dropout"], 1) for _ in range(2))
        self.v = dense(width, spec["hidden"], spec["dropout"], 1)

    def judge(self, x, actions, objects):
        parts = zip(self.actions, self.objects, self.q)
        return [q(torch.cat([x, a(actions), o(objects)], 1)).squeeze(1) for a, o, q in parts]


def cross_entropy(logits, batch, weights):
    action = F.cross_entropy(logits[0], batch["actions"], reduction="none") * weights
    object_ = F.cross_entropy(logits[1], batch["objects"], reduction="none") * weights
    interactions = (batch["objects"] > 0).float()
    return action, object_ * interactions, interactions


def averaged(parts, action, object_, interactions):
    loss = 0
    for first, last, weight in parts:
        named = object_[first:last].sum() / interactions[first:last].sum().clamp(min=1)
        loss = loss + weight * (action[first:last].mean() + named)
    return loss


def batch_of(size, chained, features):
    n = size + 3 * chained
    embedding = PRESET["policy"]["embedding"]
    return {
        "seen": torch.rand(n, features, SIDE, SIDE).half(),
        "next": torch.rand(n, features, SIDE, SIDE).half(),
        "told": torch.randn(n, embedding),
        "actions": torch.randint(ACTIONS, (n,)),
        "objects": torch.randint(CLASSES, (n,)) * (torch.rand(n) < 0.25),
        "terminal": (torch.rand(n) < 0.07).float(),
        "parts": [(0, size, 1.0)]
        + [(size + i * chained, size + (i + 1) * chained, weight) for i, weight in enumerate([0.5, 0.25, 0.25]) if chained],
    }


class Update:
    def __init__(self, method):
        training = PRESET["training"]
        features = PRESET["policy"]["history"] * PRESET["visual"]["channels"][-1]
        chained = PRESET["chaining"]["batch"] if method == "sprint" else 0
        self.batch = batch_of(training["batch"], chained, features)
        self.policy = Policy(features)
        self.critic = self.target = None
        if method == "sprint":
            self.critic, self.target = Critic(features), Critic(features)
            self.target.load_state_dict(self.critic.state_dict())
            self.target.eval()
        schedule, adamw = training["schedule"], training["adamw"]
        options = {"lr": schedule["learning_rate"], "weight_decay": adamw["weight_decay"]}
        self.optimisers = [torch.optim.AdamW(net.parameters(), **options) for net in (self.policy, self.critic) if net]

    def step(self):
        batch, weights = self.batch, 1.0
        seen, losses = batch["seen"].float(), []
        if self.critic:
            loss, weights = self.judge(seen)
            losses.append((self.optimisers[1], loss))
        losses.append((self.optimisers[0], self.extract(seen, weights)))
        for optimiser, loss in losses:
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
        if self.critic:
            with torch.no_grad():
                for own, online in zip(self.target.parameters(), self.critic.parameters()):
                    own.lerp_(online, PRESET["iql"]["target_rate"])
                for own, online in zip(self.target.buffers(), self.critic.buffers()):
                    own.copy_(online)
        return losses[0][1].item()

    def extract(self, seen, weights):
        """Demonstrated items, and by their running statistics those of equation 5."""
        batch, parts = self.batch, self.batch["parts"]
        base = slice(*parts[0][:2])
        logits = self.policy(seen[base], batch["told"][base])
        if not self.critic:
            return averaged(parts, *cross_entropy(logits, batch, weights))
        joint = slice(parts[2][0], parts[3][1])
        self.policy.eval()
        chained = self.policy(seen[joint], batch["told"][joint])
        self.policy.train()
        kept = lambda values: torch.cat([values[base], values[joint]])
        logits = [torch.cat(pair) for pair in zip(logits, chained)]
        terms = cross_entropy(logits, {name: kept(batch[name]) for name in ("actions", "objects")}, kept(weights))
        size, each = parts[0][1], parts[2][1] - parts[2][0]
        again = [parts[0], (size, size + each, parts[2][2]), (size + each, size + 2 * each, parts[3][2])]
        return averaged(again, *terms)

    def judge(self, seen):
        batch, iql, critic = self.batch, PRESET["iql"], self.critic
        chosen = (batch["actions"], batch["objects"])
        with torch.no_grad():
            q = torch.minimum(*self.target.judge(self.target.trunk(seen, batch["told"]), *chosen))
            critic.eval()
            next_value = critic.v(critic.trunk(batch["next"].float(), batch["told"])).squeeze(1)
            critic.train()
        x = critic.trunk(seen, batch["told"])
        value = critic.v(x).squeeze(1)
        with torch.no_grad():
            critic.eval()
            baseline = critic.v(x).squeeze(1)
            critic.train()
        reward = batch["terminal"].clone()
        (first, last, _), (lead, end, _) = batch["parts"][1:3]
        for start, stop in ((first, last), (lead, end)):
            reward[start:stop] *= next_value[first:last].clamp(0, 1)
        bootstrap = reward + (1 - batch["terminal"]) * iql["discount"] * next_value
        above = value - q
        expectile = torch.where(above < 0, iql["expectile"], 1 - iql["expectile"]) * above**2
        errors = sum((q - bootstrap) ** 2 for q in critic.judge(x, *chosen))
        loss = sum(weight * (expectile[a:b].mean() + errors[a:b].mean()) for a, b, weight in batch["parts"])
        return loss, ((q - baseline) * iql["temperature"]).exp().clamp(max=iql["weight_cap"])


def main():
    arguments = sys.argv[1:]
    if "--threads" in arguments:
        at = arguments.index("--threads")
        torch.set_num_threads(int(arguments[at + 1]))
        del arguments[at : at + 2]
    torch.manual_seed(1)
    print(f"torch {torch.__version__}, {torch.get_num_threads()} threads; milliseconds, medians of {STEPS} and the least")
    for method in arguments or ["l-bc", "sprint"]:
        update, times = Update(method), []
        for step in range(WARM + STEPS):
            begun = time.perf_counter()
            update.step()
            times.append((time.perf_counter() - begun) * 1e3)
        print(f"{method:<18} {statistics.median(times[WARM:]):8.1f} {min(times[WARM:]):8.1f}")


if __name__ == "__main__":
    main()
