"""AI2-THOR through `ai2thor`'s own controller, with a player in Unity's place. Unity itself has not been met."""

import json
import socket
import tempfile
import unittest
from pathlib import Path

from sprint_env.alfred_task import Changes, Goal, find_tasks, read_task
from sprint_env.environment import CannotDo
from sprint_env.thor_candidates import class_of
from sprint_env.thor_environment import ThorEnvironment, open_controller
from tests.stand_in_player import BREAD, FAUCET, FRIDGE, KNIFE, MICROWAVE, MUG, SINK, StandInPlayer, thing


def recorded(kind: str, **asked: object) -> dict:
    """A task as ALFRED records it."""
    names = {"object_target": "Mug", "parent_target": "SinkBasin", "mrecep_target": "", "toggle_target": ""}
    start = {"action": "TeleportFull", "x": 0.25, "y": 1.0, "z": 0.0, "rotation": 90, "horizon": 30, "rotateOnTeleport": True}
    return {
        "task_id": "trial_1",
        "task_type": kind,
        "pddl_params": {**names, "object_sliced": False, **asked},
        "scene": {
            "floor_plan": "FloorPlan1",
            "object_poses": [{"objectName": "Mug_1", "position": {"x": 0, "y": 1, "z": 0}}],
            "object_toggles": [{"objectType": "Faucet", "isOn": False}],
            "dirty_and_empty": True,
            "init_action": start,
        },
        "turk_annotations": {"anns": [{"task_desc": "Rinse the mug. "}, {"task_desc": "Wash a cup."}]},
    }


class ThorTest(unittest.TestCase):
    def play(self, kind: str, steps: int = 50, **asked: object) -> ThorEnvironment:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "traj_data.json"
            path.write_text(json.dumps(recorded(kind, **asked)))
            tasks = find_tasks([folder])
        with socket.create_server(("127.0.0.1", 0)) as probe:
            port = probe.getsockname()[1]
        self.player = StandInPlayer(port)
        controller = open_controller("FloorPlan1", None, port)
        environment = ThorEnvironment(controller, tasks, steps)
        self.addCleanup(environment.close)
        return environment

    def asked(self, name: str) -> list[dict]:
        return [action for action in self.player.kitchen.asked if action["action"] == name]

    def test_a_scene_is_set_as_alfred_sets_it(self) -> None:
        environment = self.play("pick_clean_then_place_in_recep")
        self.player.kitchen.asked.clear()
        seen = environment.reset(0, None)
        order = [action["action"] for action in self.player.kitchen.asked]
        setting = ["SetObjectToggles", "SetStateOfAllObjects", "SetStateOfAllObjects", "SetObjectPoses", "TeleportFull"]
        self.assertEqual(order, ["Reset", "Initialize", *setting])
        started = self.player.kitchen.asked[1]
        self.assertEqual((started["gridSize"], started["cameraY"], started["visibilityDistance"]), (0.25, 0.75, 1.5))
        changes = [(action["StateChange"], action["forceAction"]) for action in self.asked("SetStateOfAllObjects")]
        self.assertEqual(changes, [("CanBeDirty", True), ("CanBeFilled", False)])
        self.assertEqual(self.asked("TeleportFull")[0]["rotation"], {"y": 90})
        self.assertEqual((seen.mission, seen.success), ("Rinse the mug.", False))
        self.assertEqual(environment.reset(1, None).mission, "Wash a cup.")

    def test_what_could_be_done_follows_from_metadata(self) -> None:
        environment = self.play("pick_clean_then_place_in_recep")
        seen = environment.reset(0, None)
        told = environment.capabilities()
        self.assertEqual((len(told.actions), len(told.arguments["class"])), (12, 81))
        legal = dict(zip([action.name for action in told.actions], seen.legal))
        self.assertEqual(legal["MoveAhead"], True)
        self.assertEqual(set(legal["Pickup"]), {"Mug", "Knife", "Bread"}, "the apple is out of reach")
        self.assertEqual((legal["Put"], legal["Slice"], legal["Close"]), ([], [], []))
        self.assertEqual(set(legal["Open"]), {"Fridge", "Microwave"})
        self.assertEqual(set(legal["ToggleOn"]), {"Faucet", "Microwave"})
        seen = environment.step("Pickup", "Knife")
        self.assertEqual((seen.legal[5], set(seen.legal[6]), seen.legal[11]), ([], {"Sink", "CounterTop"}, ["Bread"]))
        self.assertEqual([(it.name, it.box) for it in seen.things], [("Mug", (30, 180, 60, 200))])
        self.assertEqual((seen.frame.width, seen.frame.height, seen.frame.rgb[0]), (300, 300, 90))

    def test_a_mug_is_rinsed_and_put_back_and_that_is_success(self) -> None:
        environment = self.play("pick_clean_then_place_in_recep", parent_target="CounterTop")
        environment.reset(0, None)
        deeds = [("Pickup", "Mug"), ("Put", "Sink"), ("ToggleOn", "Faucet"), ("ToggleOff", "Faucet"), ("Pickup", "Mug")]
        for deed in deeds:
            self.assertFalse(environment.step(*deed).done)
        self.assertEqual([action["objectId"] for action in self.asked("CleanObject")], [MUG])
        seen = environment.step("Put", "CounterTop")
        self.assertEqual((seen.success, seen.terminated, seen.reward), (True, True, 1.0))

    def test_a_mug_that_was_heated_elsewhere_counts_and_one_that_was_not_does_not(self) -> None:
        environment = self.play("pick_heat_then_place_in_recep")
        environment.reset(0, None)
        heating = [("Open", "Microwave"), ("Put", "Microwave"), ("Close", "Microwave"), ("ToggleOn", "Microwave")]
        out = [("ToggleOff", "Microwave"), ("Open", "Microwave"), ("Pickup", "Mug")]
        for deed in [("Pickup", "Mug"), ("Put", "Sink")]:
            self.assertFalse(environment.step(*deed).success)
        for deed in [("Pickup", "Mug"), *heating, *out]:
            self.assertFalse(environment.step(*deed).success)
        self.assertTrue(environment.step("Put", "Sink").success)

    def test_what_is_impossible_takes_a_step_and_changes_nothing(self) -> None:
        environment = self.play("pick_and_place_simple", steps=3)
        first = environment.reset(0, None)
        self.player.kitchen.asked.clear()
        self.assertEqual(environment.step("Slice", "Bread").legal, first.legal)
        self.assertEqual(self.player.kitchen.asked, [])
        environment.step("Open", "Microwave")
        seen = environment.step("ToggleOn", "Microwave")
        self.assertEqual((seen.success, seen.truncated), (False, True), "the player refused, the steps are used up")

    def test_turns_and_looks_are_alfreds(self) -> None:
        environment = self.play("pick_and_place_simple")
        environment.reset(0, None)
        self.assertEqual(environment.step("RotateLeft", None).frame.rgb[0], 0)
        environment.step("LookDown", None)
        environment.step("MoveAhead", None)
        self.assertEqual(self.asked("LookDown")[0]["degrees"], 15)
        self.assertEqual(self.asked("MoveAhead")[0]["moveMagnitude"], 0.25)


class GoalTest(unittest.TestCase):
    def met(self, kind: str, things: list[dict], held: set[str] = frozenset(), **names: str) -> bool:
        names = {"target": "Mug", "place": "Fridge", "carrier": "", "lamp": "", **names}
        return Goal(kind=kind, **names).met(things, held, Changes())

    def test_each_kind_of_task_is_done_when_alfred_says_so(self) -> None:
        def mug(number: int) -> dict:
            return thing(f"Mug|{number}|1|1", pickupable=True)

        def holding(name: str, *held: dict, **facts: object) -> dict:
            return thing(name, receptacle=True, receptacleObjectIds=[it["objectId"] for it in held], **facts)

        one, two = mug(1), mug(2)
        simple = "pick_and_place_simple"
        self.assertTrue(self.met(simple, [one, holding(FRIDGE, one)]))
        self.assertFalse(self.met(simple, [one, holding(FRIDGE), holding(SINK, one)]))
        both = "pick_two_obj_and_place"
        self.assertTrue(self.met(both, [one, two, holding(FRIDGE, one, two)]))
        self.assertFalse(self.met(both, [one, two, holding(FRIDGE, one), holding("Fridge|5|0|0", two)]))
        lit = "look_at_obj_in_light"
        lamp = thing("DeskLamp|0|1|0", toggleable=True, isToggled=True)
        self.assertTrue(self.met(lit, [one, lamp], {one["objectId"]}, lamp="DeskLamp"))
        self.assertFalse(self.met(lit, [one, {**lamp, "isToggled": False}], {one["objectId"]}, lamp="DeskLamp"))
        self.assertFalse(self.met(lit, [one, lamp], lamp="DeskLamp"))
        carried = "pick_and_place_with_movable_recep"
        bowl = holding("Bowl|1|1|1", one, pickupable=True)
        self.assertTrue(self.met(carried, [one, bowl, holding(FRIDGE, bowl)], carrier="Bowl"))
        self.assertFalse(self.met(carried, [one, bowl, holding(FRIDGE, one)], carrier="Bowl"))
        sliced = thing("Bread|1|1|1|BreadSliced_2", pickupable=True)
        self.assertTrue(self.met(simple, [sliced, holding(FRIDGE, sliced)], target="BreadSliced"))
        self.assertFalse(self.met(simple, [thing(BREAD), holding(FRIDGE, thing(BREAD))], target="BreadSliced"))

    def test_a_slice_is_cool_when_its_whole_was(self) -> None:
        piece = thing(f"{BREAD}|BreadSliced_2")
        places = [thing(FRIDGE, receptacle=True, receptacleObjectIds=[piece["objectId"]])]
        goal = Goal("pick_cool_then_place_in_recep", "BreadSliced", "Fridge", "", "")
        self.assertTrue(goal.met([piece, *places], set(), Changes(cooled={BREAD})))
        self.assertFalse(goal.met([piece, *places], set(), Changes()))

    def test_classes_go_by_ids_whatever_the_size_of_their_letters(self) -> None:
        names = [SINK, FAUCET, MICROWAVE, KNIFE, "Basketball|0|0|0", "Floor|0|0|0"]
        self.assertEqual([class_of(name) for name in names], ["Sink", "Faucet", "Microwave", "Knife", "BasketBall", None])

    def test_a_file_that_is_no_task_is_named(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "traj_data.json"
            path.write_text("{}")
            with self.assertRaisesRegex(CannotDo, "traj_data.json: this is no traj_data.json.*scene"):
                read_task(path)
            path.unlink()
            with self.assertRaisesRegex(CannotDo, "no traj_data.json was found"):
                find_tasks([folder])


if __name__ == "__main__":
    unittest.main()
