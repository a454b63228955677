#!/usr/bin/env python3
"""Trains the reader's model (assets/reader/model.bin) on an import of ALFRED.

    pip install numpy scipy zstandard
    python3 assets/reader/train.py DATA [--sprint target/release/sprint] [--out assets/reader/model.bin]

DATA is a folder that `sprint import` wrote. Only trajectories of the split `train` are read. Every tenth of them is kept from
the weights: on those the confidence is calibrated. The features come from `sprint read --features`, so that there is one
implementation of them. The format of the file is described in src/language/reader/model.rs.
"""

import argparse
import collections
import hashlib
import io
import json
import math
import random
import re
import struct
import subprocess
import tempfile
import tomllib
from pathlib import Path

import numpy as np
import scipy.sparse as sp
import zstandard

ROOT = Path(__file__).resolve().parents[2]
SHAPES = ["Pickup", "Put", "Slice", "Toggle", "Clean", "Heat", "Cool", "Look", "Stack", "CleanPut", "HeatPut", "CoolPut", "Two", "Many"]
KNIVES = ("Knife", "ButterKnife")


def skills_of(roles, subtasks):
    """Skills as (skill, class, slice, receptacle class)."""
    place = lambda one: roles[one["receptacle"]]["class"] if one.get("receptacle") is not None else None
    role = lambda one: roles[one["object"]]
    return [(one["skill"], role(one)["class"], role(one)["slice"], place(one)) for one in subtasks]


def trajectories(folder):
    """Trajectories of the training split, or the tasks of a task file: id, skills, annotations, and whether the sentence for
    the whole is a person's outline, as ALFRED's are."""
    if folder.endswith(".json"):
        for one in json.loads(Path(folder).read_text())["tasks"]:
            told = {"goal": one["instruction"], "steps": one["sentences"]}
            yield one["id"], skills_of(one["roles"], one["subtasks"]), [told], False
        return
    reader = zstandard.ZstdDecompressor()
    with open(Path(folder) / "trajectories.jsonl.zst", "rb") as file:
        for line in io.TextIOWrapper(reader.stream_reader(file), encoding="utf-8"):
            one = json.loads(line)
            if one["split"] != "train":
                continue
            yield one["id"], skills_of(one["roles"], one["skills"]), one["annotations"], one.get("goal") is not None


def is_held_out(name):
    return hashlib.sha256(name.encode()).digest()[0] % 10 == 0


def canonical(skills, is_outline=False):
    """What some skills come to: as `canonical` in tests/reader.rs. An outline does not say where the knife is left."""
    cuts = any(skill[0] == "Slice" for skill in skills)
    kept = []
    for at, skill in enumerate(skills):
        implied = skill[0] == "Pickup" and any(
            other[0] not in ("Pickup", "Slice") and other[1] == skill[1] for other in skills[at + 1:])
        knife = cuts and skill[1] in KNIVES and len(skills) > 1 and (is_outline or skill[0] == "Pickup")
        aside = skill[0] == "Put" and any(other[0] == "Slice" and other[1] == skill[1] for other in skills[at + 1:])
        again = skill[0] == "Slice" and any(other[0] == "Slice" and other[1] == skill[1] for other in kept)
        if not (implied or knife or aside or again):
            kept.append(skill)
    for at in range(1, len(kept)):
        first, second = kept[at - 1], kept[at]
        if first[0] == second[0] == "Put" and second[3] == first[1] != second[1]:
            kept[at - 1], kept[at] = second, first
    return kept


def label(skills, is_outline=False):
    """The shape of some skills, with slots: shape, slice, object, place, movable; None is "not asked"."""
    if not skills:
        return "Many", None, None, None, None
    steps = canonical(skills, is_outline)
    kinds = [step[0] for step in steps]
    sliced = None
    if len(steps) > 1 and kinds[0] == "Slice" and all(step[1] == steps[0][1] for step in steps[1:2]):
        sliced, steps, kinds = 1, steps[1:], kinds[1:]
    if len(steps) == 1 and (sliced is None or kinds[0] == "Put"):
        kind, thing, piece, place = steps[0]
        return kind, sliced or int(piece), thing, place, None
    if len(steps) == 2 and steps[0][1] == steps[1][1] and kinds[1] == "Put" and kinds[0] in ("Clean", "Heat", "Cool"):
        return kinds[0] + "Put", sliced or int(steps[0][2]), steps[0][1], steps[1][3], None
    if kinds == ["Put", "Put"] and steps[0][1] == steps[1][1] and steps[0][3] == steps[1][3]:
        return "Two", sliced or int(steps[0][2]), steps[0][1], steps[0][3], None
    if kinds == ["Put", "Put"] and steps[0][3] == steps[1][1]:
        return "Stack", sliced or int(steps[0][2]), steps[0][1], steps[1][3], steps[0][3]
    if kinds == ["Pickup", "Toggle"]:
        return "Look", sliced or int(steps[0][2]), steps[0][1], steps[1][1], None
    return "Many", None, None, None, None


JOINS = [". ", ". ", ". ", " and ", ", then ", " then ", ", and then ", ", ", ". Then ", "; "]


def joined(texts, chance):
    out = texts[0].strip().rstrip(".!")
    for text in texts[1:]:
        text = text.strip().rstrip(".!")
        join = chance.choice(JOINS)
        if not join.startswith((".", ";")) and text:
            text = text[0].lower() + text[1:]
        out += join + text
    return out


def after(skill):
    """What is known after a skill: the thing, and where it was put."""
    return {"object": skill[1], "place": skill[3]}


def examples(folder, chance):
    """(held out, kind, text, before, label)."""
    pool = []
    for name, skills, annotations, is_outlined in trajectories(folder):
        held = is_held_out(name)
        for told in annotations:
            yield held, "goal", told["goal"], {}, label(skills, is_outlined)
            steps = told["steps"]
            if len(steps) != len(skills):
                continue
            for i, (text, skill) in enumerate(zip(steps, skills)):
                before = after(skills[i - 1]) if i and chance.random() < 0.8 else {}
                named = label([skill])
                if not before and i and re.search(r"\b(it|them)\b", text.lower()) and not any(
                        word.lower() in text.lower() for word in WORDS[skill[1]]):
                    named = named[:2] + ("None",) + named[3:]
                yield held, "step", text, before, named
            if len(steps) > 1:
                for _ in range(2):
                    length = chance.randint(2, min(5, len(steps)))
                    start = chance.randint(0, len(steps) - length)
                    before = after(skills[start - 1]) if start else {}
                    yield held, "joined", joined(steps[start:start + length], chance), before, label(skills[start:start + length])
            length = chance.choice([1, 1, 2])
            start = chance.randint(0, max(0, len(steps) - length))
            length = min(length, len(steps) - start)
            if not points_back(steps[start]):
                pool.append((steps[start:start + length], skills[start:start + length]))
            if len(pool) > 400:
                some = chance.sample(pool, chance.choice([2, 2, 2, 3]))
                texts, parts = [text for told, _ in some for text in told], [skill for _, part in some for skill in part]
                yield held, "joined", joined(texts, chance), {}, label(parts)
                pool = pool[-400:]


def points_back(text):
    """Whether a sentence speaks of what came before it."""
    return re.search(r"\b(it|them|that)\b", text.lower()) is not None


def class_words():
    """Every name of every class, from the program's tables."""
    objects = tomllib.loads((ROOT / "assets/objects.toml").read_text())["class"][:81]
    heads = tomllib.loads((ROOT / "assets/nouns.toml").read_text())["heads"]
    names = tomllib.loads((ROOT / "assets/phrases.toml").read_text())["names"]
    spoken = {one["name"]: [one["spoken"]] + heads.get(one["name"], []) + names.get(one["name"], []) for one in objects}
    return {name: list(dict.fromkeys(all)) for name, all in spoken.items()}, {one["name"]: one for one in objects}


WORDS, OBJECTS = class_words()
THINGS = [name for name, one in OBJECTS.items() if one.get("pickupable")]
PLACES = [name for name, one in OBJECTS.items() if one.get("receptacle")]
HOLDERS = [name for name in PLACES if name in THINGS]
FOODS = [name for name, one in OBJECTS.items() if one.get("slices")]
UNAMBIGUOUS = {name: [word for word in words if sum(word in other for other in WORDS.values()) == 1] for name, words in WORDS.items()}


def one_made_up(chance):
    """A sentence with the skills that it asks for."""
    pick = lambda *words: chance.choice(words)
    names = lambda name: UNAMBIGUOUS[name] or WORDS[name][:1]
    noun = lambda name: WORDS[name][0].lower() if chance.random() < 0.4 else pick(*names(name))
    say = lambda name: pick("the ", "the ", "a ", "my ", "") + noun(name)
    prep = lambda: pick("in", "on", "into", "onto", "to", "on top of", "inside")
    thing, place, lamp = pick(*THINGS), pick(*PLACES), pick("DeskLamp", "FloorLamp")
    x, y = say(thing), say(place)
    verb = lambda: pick("put", "put", "place", "set", "move", "leave", "drop", "carry", "bring", "return", "store", "keep")
    take = lambda: pick("pick up", "take", "grab", "get", "fetch", "bring me", "find", "pick", "lift", "collect", "hold")
    near = f" {pick('from', 'on', 'in', 'next to', 'by', 'near', 'that is on')} {say(pick(*PLACES))}" if chance.random() < 0.4 else ""
    skill = pick("Clean", "Heat", "Cool")
    do = lambda: pick(*{"Clean": ["wash", "rinse", "clean"], "Heat": ["heat", "warm", "microwave", "cook"], "Cool": ["chill", "cool"]}[skill])
    adjective = pick(*{"Clean": ["clean", "washed", "rinsed"], "Heat": ["hot", "warm", "heated", "cooked"], "Cool": ["cold", "chilled", "cooled", "cool"]}[skill])
    up = {"Clean": ["", "", " off"], "Heat": ["", "", " up"], "Cool": ["", "", " down", " off"]}[skill]
    changed, put = (skill, thing, False, None), ("Put", thing, False, place)
    food = pick(*FOODS)
    kind = chance.randrange(20)
    if kind == 0:
        return pick(f"{take()} {x}{near}", f"{take()} {x}{near}", f"want {x}"), [("Pickup", thing, False, None)]
    if kind in (1, 2):
        return f"{verb()} {x}{near if chance.random() < 0.3 else ''} {prep()} {y}", [put]
    if kind == 3:
        f = say(food)
        return pick(f"{pick('slice', 'cut', 'cut up')} {f}{near}", f"want {f} sliced", f"make slices of {f}"), [("Slice", food, False, None)]
    if kind == 4:
        lit = say(lamp)
        return pick(f"{pick('turn on', 'switch on', 'light')} {lit}", f"{pick('turn', 'switch', 'put')} {lit} on"), [("Toggle", lamp, False, None)]
    if kind == 5:
        return f"{do()}{pick(*up)} {x}{near}", [changed]
    if kind == 6:
        wash = [f"give {x} a {pick('rinse', 'wash', 'good wash', 'good rinse')}", f"{do()} the dirty {noun(thing)}", f"{x} is dirty, wash it"] if skill == "Clean" else []
        let = [f"let {x} {do()}", f"let {x} cool down in the fridge"] if skill == "Cool" else []
        return pick(f"make {x} {adjective}", f"get {x} {adjective}", f"want {x} {adjective}", f"make sure {x} is {adjective}", f"{x} should be {adjective}", *wash, *let), [changed]
    if kind in (7, 8):
        n = noun(thing)
        return pick(f"{verb()} a {adjective} {n} {prep()} {y}", f"{verb()} a {adjective} {n} {prep()} {y}", f"{verb()} the {adjective} {n} {prep()} {y}", f"want a {adjective} {n} {prep()} {y}", f"there should be a {adjective} {n} {prep()} {y}", f"make sure there is a {adjective} {n} {prep()} {y}", f"{adjective} {n} {prep()} {y}"), [changed, put]
    if kind == 9:
        n = noun(thing)
        many = n if n.endswith("s") else n + "s"
        return pick(f"{verb()} {pick('two', 'both', '2', 'both the', 'a pair of')} {many} {prep()} {y}", f"want two {many} {prep()} {y}"), [put, put]
    if kind == 10:
        holder = pick(*HOLDERS)
        if holder in (thing, place) or place == thing:
            return None
        h = say(holder)
        inner = ("Put", thing, False, holder)
        return pick(f"{verb()} {x} {pick('in', 'on')} {h} {pick('and', ', then', 'and then')} {pick('put', 'move')} {pick('it', 'that', h)} {prep()} {y}", f"{verb()} {h} with {x} {pick('in it', 'on it', 'inside', '')} {prep()} {y}"), [inner, ("Put", holder, False, place)]
    if kind == 11:
        lit = say(lamp)
        return pick(f"examine {x} under {lit}", f"look at {x} by the light of {lit}", f"examine {x} in the light of {lit}", f"{take()} {x} and turn on {lit}", f"examine {x} with {lit} on", f"hold {x} under {lit} and turn it on"), [("Pickup", thing, False, None), ("Toggle", lamp, False, None)]
    if kind == 12:
        return f"{take()} {x}{near} {pick('and', ', then', ', and')} {verb()} it {prep()} {y}", [("Pickup", thing, False, None), put]
    if kind == 13:
        other = pick(*THINGS)
        if other == thing:
            return None
        z = say(other)
        return pick((f"{verb()} {x} and {z} {prep()} {y}", [put, ("Put", other, False, place)]), (f"{do()} {x} and {z}", [changed, (skill, other, False, None)]), (f"{take()} {x} and {z}{near}", [("Pickup", thing, False, None), ("Pickup", other, False, None)]))
    if kind == 14:
        return pick(f"{do()} {x} {pick('and', ', then', ', and')} {verb()} it {prep()} {y}", f"{take()} {x}, {do()} it and {verb()} it {prep()} {y}"), [changed, put]
    if kind == 15:
        return pick(f"want {x} {prep()} {y}", f"{x} {pick('belongs', 'goes', 'should be', 'must be')} {prep()} {y}", f"make sure {x} is {prep()} {y}", f"{x} to {y}", f"get {x} {pick('in', 'on', 'into', 'onto')} {y}"), [put]
    if kind == 16:
        source = pick(f" from {say(pick(*PLACES))}", "", " over")
        return f"{pick('take', 'take', 'bring', 'carry', 'move', 'get')} {x}{source} to {y}", [put]
    if kind == 17:
        return f"{pick('discard', 'throw out', 'bin', 'trash')} {x}{near}", [("Put", thing, False, "GarbageCan")]
    if kind == 18:
        f = say(food)
        changed = (skill, food, True, None)
        return f"{pick('slice', 'cut')} {f} {pick('and', ', then', ', and')} {do()} {pick('a slice', 'a piece', 'one slice', 'it')}", [("Slice", food, False, None), changed]
    return f"{take()} {x}{near} and {do()}{pick(*up)} {pick('it', 'it', noun(thing))}", [("Pickup", thing, False, None), changed]


def made_up(chance, count):
    """Sentences of all classes, by names that stand for one class alone, so that rare ones are known as well; some joined."""
    made = []
    for _ in range(count):
        one = one_made_up(chance)
        if one is None:
            continue
        made.append(one)
        polite = chance.choice(["", "", "", "", "please ", "could you ", "want you to ", "would you mind ", "can you please "])
        yield polite + one[0], label(one[1])
        if len(made) > 3 and chance.random() < 0.5:
            some = chance.sample(made[-1000:], chance.choice([2, 2, 3]))
            yield joined([text for text, _ in some], chance), label([skill for _, skills in some for skill in skills])


def softmax_fit(features, labels, count, sure, epochs, rate=0.12, decay=2e-6, seed=1):
    """Weights of a linear softmax by AdaGrad over small batches; `decay` pulls weights to zero (L1)."""
    chance = np.random.default_rng(seed)
    rows, columns = features.shape
    weights = np.zeros((columns, count), np.float32)
    bias = np.zeros(count, np.float32)
    square = np.full((columns, count), 1e-2, np.float32)
    bias_square = np.full(count, 1e-2, np.float32)
    for epoch in range(epochs):
        order = chance.permutation(rows)
        step = rate * (1 - epoch / epochs) + 0.01
        for start in range(0, rows, 256):
            some = order[start:start + 256]
            part = features[some]
            used = np.unique(part.indices)
            dense = part[:, used]
            scores = dense @ weights[used] + bias
            scores -= scores.max(1, keepdims=True)
            np.exp(scores, out=scores)
            scores /= scores.sum(1, keepdims=True)
            scores[np.arange(len(some)), labels[some]] -= 1
            scores *= sure[some, None]
            slope = (dense.T @ scores) / len(some) * 16
            square[used] += slope * slope
            change = weights[used] - step * slope / np.sqrt(square[used])
            shrink = decay * step / np.sqrt(square[used]) * 256
            weights[used] = np.sign(change) * np.maximum(np.abs(change) - shrink, 0)
            slope = scores.mean(0) * 16
            bias_square += slope * slope
            bias -= step * slope / np.sqrt(bias_square)
    return weights, bias


def text_bytes(text):
    raw = text.encode()
    return struct.pack("B", len(raw)) + raw


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("data", nargs="+", help="dataset folders and task files: ALFRED's, and generated houses for the grammar's own words")
    parser.add_argument("--sprint", default=str(ROOT / "target/release/sprint"))
    parser.add_argument("--features", default="read --features", help=argparse.SUPPRESS)
    parser.add_argument("--out", default=str(ROOT / "assets/reader/model.bin"))
    parser.add_argument("--epochs", type=int, default=7)
    parser.add_argument("--made-up", type=int, default=14000)
    parser.add_argument("--rare", type=int, default=3, help="features that fewer examples have are left out")
    parser.add_argument("--small", type=float, default=0.04, help="weights below this are left out")
    options = parser.parse_args()
    chance = random.Random(7)
    rows = [row for folder in options.data for row in examples(folder, chance)]
    counts = collections.Counter(word for row in rows if row[1] in ("step", "goal") for word in set(re.findall(r"[^\W_]+(?:'[^\W_]+)?", row[2].lower())))
    words = [word for word, count in counts.most_common() if count >= 6 and len(word.encode()) < 60]
    rows += [(False, "made up", text, {}, named) for text, named in made_up(chance, options.made_up)]
    print(f"{len(rows)} examples, {len(words)} words")
    with tempfile.NamedTemporaryFile("w", suffix=".txt") as file:
        file.write("\n".join(words))
        file.flush()
        lines = "\n".join(json.dumps({"text": row[2], **{k: v for k, v in row[3].items() if v}}) for row in rows)
        command = [options.sprint, *options.features.split(), file.name]
        printed = subprocess.run(command, input=lines, text=True, capture_output=True, check=True).stdout
    seen = [np.array(line.split(), np.uint32) for line in printed.splitlines()]
    assert len(seen) == len(rows)
    fitted = np.array([not row[0] for row in rows])
    hashes, often = np.unique(np.concatenate([one for one, fit in zip(seen, fitted) if fit]), return_counts=True)
    hashes = hashes[often >= options.rare]
    print(f"{len(hashes)} features")
    starts, indices = [0], []
    for one in seen:
        at = np.searchsorted(hashes, one)
        at[at == len(hashes)] = 0
        found = at[hashes[at] == one]
        indices.append(found)
        starts.append(starts[-1] + len(found))
    indices = np.concatenate(indices).astype(np.int32)
    matrix = sp.csr_matrix((np.ones(len(indices), np.float32), indices, np.array(starts)), shape=(len(rows), len(hashes)))
    sure_of = {"step": 1.0, "goal": 2.0, "joined": 0.7, "made up": 0.5}
    classes = ["None"] + list(OBJECTS)
    heads = [("shape", 0, SHAPES), ("slice", 1, [0, 1]), ("object", 2, classes), ("place", 3, classes), ("movable", 4, classes)]
    blob = [b"SPRD", struct.pack("<I", 1), struct.pack("<I", len(words))] + [text_bytes(word) for word in words]
    blob.append(struct.pack("B", len(heads)))
    chances = np.ones(len(rows))
    right = np.ones(len(rows), bool)
    for name, slot, labels in heads:
        place = {one: i for i, one in enumerate(labels)}
        asked = np.array([row[4][slot] is not None for row in rows])
        truth = np.array([place.get(row[4][slot], 0) for row in rows])
        sure = np.array([sure_of[row[1]] for row in rows], np.float32)
        mine = np.flatnonzero(asked & fitted)
        weights, bias = softmax_fit(matrix[mine], truth[mine], len(labels), sure[mine], options.epochs)
        weights[np.abs(weights) < options.small] = 0
        scale = float(np.abs(weights).max()) / 127 or 1.0
        scale = min(scale, 0.04)
        quantised = np.clip(np.round(weights / scale), -127, 127).astype(np.int8)
        other = np.flatnonzero(asked & ~fitted)
        scores = matrix[other] @ (quantised.astype(np.float32) * scale) + bias
        scores -= scores.max(1, keepdims=True)
        p = np.exp(scores)
        p /= p.sum(1, keepdims=True)
        chosen = p.argmax(1)
        hit = chosen == truth[other]
        kinds = np.array([rows[i][1] for i in other])
        by = {str(kind): f"{100 * hit[kinds == kind].mean():.2f}" for kind in np.unique(kinds)}
        kept = np.flatnonzero(quantised.any(1))
        print(f"{name}: right of the tenth kept apart {by}; {len(kept)} features, {np.count_nonzero(quantised)} weights")
        if name != "slice":
            chances[other] *= p.max(1)
            right[other] &= hit
        blob.append(text_bytes(name) + struct.pack("B", len(labels)))
        blob += [text_bytes(str(one)) for one in labels]
        blob.append(struct.pack(f"<{len(labels)}f", *bias.tolist()))
        blob.append(struct.pack("<fI", scale, len(kept)))
        for at in kept:
            some = np.flatnonzero(quantised[at])
            blob.append(struct.pack("<IB", int(hashes[at]), len(some)))
            blob.append(b"".join(struct.pack("Bb", int(one), int(quantised[at, one])) for one in some))
    judged = np.array([row[0] and row[1] in ("step", "goal") for row in rows])
    odds = np.clip(chances[judged], 1e-6, 1 - 1e-6)
    odds = np.log(odds / (1 - odds))
    slope, offset = 1.0, 0.0
    for _ in range(4000):
        p = 1 / (1 + np.exp(-(slope * odds + offset)))
        wrong = p - right[judged]
        slope -= 0.05 * np.mean(wrong * odds)
        offset -= 0.05 * np.mean(wrong)
    print(f"calibration: {slope:.3f} {offset:.3f}; right {100 * right[judged].mean():.2f} %")
    blob.append(struct.pack("<ff", slope, offset))
    Path(options.out).write_bytes(b"".join(blob))
    print(f"{options.out}: {sum(map(len, blob))} bytes")


if __name__ == "__main__":
    main()
