"""A conversation without a socket."""

import base64
import contextlib
import io
import json
import unittest
import zlib

from sprint_env.frames import formats_of, png
from sprint_env.environment import Frame
from sprint_env.session import Session
from tests.corridor import Corridor


class SessionTest(unittest.TestCase):
    def setUp(self) -> None:
        self.session = Session(Corridor())

    def ask(self, kind: str, **data: object) -> dict:
        answer = self.session.answer(json.dumps({"type": kind, "data": data}))
        assert answer is not None
        return json.loads(answer)

    def refusal(self, kind: str, **data: object) -> tuple[str, str]:
        answer = self.ask(kind, **data)
        self.assertEqual(answer["type"], "error")
        return answer["data"]["code"], answer["data"]["message"]

    def test_an_episode_goes_from_reset_to_success(self) -> None:
        seen = self.ask("reset", seed=3)["data"]
        self.assertEqual((seen["done"], seen["observation"]["success"]), (False, False))
        self.assertEqual(seen["observation"]["legal"], [True, True, [], True])
        self.assertIsNone(seen["reward"], "a reward that is no number is none")
        self.ask("step", action="ahead")
        seen = self.ask("step", action="open", argument="door")["data"]
        self.assertEqual((seen["done"], seen["reward"]), (True, 1.0))
        self.assertTrue(seen["observation"]["success"] and seen["observation"]["terminated"])
        self.assertEqual(seen["observation"]["subtasks"], [{"text": "open the door", "done": True}])
        self.assertEqual(self.ask("state")["data"], {"episode_id": None, "step_count": 2})
        self.assertEqual(self.refusal("step", action="back")[0], "EXECUTION_ERROR")

    def test_capabilities_name_actions_arguments_and_formats(self) -> None:
        told = self.ask("capabilities")["data"]
        self.assertEqual(told["actions"][2], {"name": "open", "argument": "thing"})
        self.assertEqual(told["arguments"], {"thing": ["door", "window"], "words": None})
        self.assertEqual((told["frame"], told["formats"]), ([2, 1], ["raw", "png"]))

    def test_frames_come_in_the_format_that_was_asked_for(self) -> None:
        frame = self.ask("reset", seed=4)["data"]["observation"]["frame"]
        self.assertEqual(base64.b64decode(frame["data"]), bytes([4, 0, 0, 0, 0, 255]))
        frame = self.ask("format", format="png")["data"]["observation"]["frame"]
        self.assertEqual((frame["encoding"], frame["width"], frame["height"]), ("png", 2, 1))
        self.assertTrue(base64.b64decode(frame["data"]).startswith(b"\x89PNG"))
        self.assertEqual(self.refusal("format", format="jpeg")[0], "VALIDATION_ERROR")

    def test_a_snapshot_is_gone_back_to_as_often_as_wanted(self) -> None:
        start = self.ask("reset", seed=1)
        name = self.ask("snapshot")["data"]["id"]
        for _ in range(2):
            self.ask("step", action="ahead")
            self.assertEqual(self.ask("restore", id=name)["data"], start["data"])
        self.assertEqual(self.ask("state")["data"]["step_count"], 0)
        self.assertIn("'9'", self.refusal("restore", id="9")[1])

    def test_what_is_wrong_is_named_and_changes_nothing(self) -> None:
        self.assertEqual(self.refusal("step", action="ahead")[0], "EXECUTION_ERROR")
        self.ask("reset")
        for data, part in [
            ({"action": "fly"}, "there is no 'fly', only back, ahead"),
            ({"action": "open"}, "open takes a thing"),
            ({"action": "open", "argument": "wall"}, "'wall' is no thing"),
            ({"action": "ahead", "argument": "door"}, "ahead takes none"),
            ({}, "there is no None"),
        ]:
            code, message = self.refusal("step", **data)
            self.assertEqual(code, "VALIDATION_ERROR")
            self.assertIn(part, message)
        self.assertEqual(self.refusal("reset", seed=-1)[0], "VALIDATION_ERROR")
        self.assertEqual(self.refusal("step", action="open", argument="door"), (
            "EXECUTION_ERROR", "the door is too far away"))
        with contextlib.redirect_stderr(io.StringIO()) as said:
            self.assertEqual(self.refusal("step", action="say", argument="boom")[1], "ZeroDivisionError: boom")
        self.assertIn("Traceback", said.getvalue())
        self.assertEqual(self.ask("state")["data"]["step_count"], 0)

    def test_messages_that_are_none_are_answered_in_openenvs_codes(self) -> None:
        for text, code in [
            ("{", "INVALID_JSON"),
            ("[" * 100_000, "INVALID_JSON"),
            ("7", "VALIDATION_ERROR"),
            ('{"type": "step", "data": 7}', "VALIDATION_ERROR"),
            ('{"type": "fly"}', "UNKNOWN_TYPE"),
        ]:
            answer = json.loads(self.session.answer(text))
            self.assertEqual((answer["type"], answer["data"]["code"]), ("error", code))
        self.assertIsNone(self.session.answer('{"type": "close"}'))


class FramesTest(unittest.TestCase):
    def test_a_png_holds_the_pixels(self) -> None:
        pixels = bytes(range(24)) + bytes(range(24)) + bytes(24)
        file = png(Frame(8, 3, pixels))
        length = int.from_bytes(file[33:37], "big")
        self.assertEqual(file[37:41], b"IDAT")
        rows = zlib.decompress(file[41 : 41 + length])
        self.assertEqual([rows[0], rows[25], rows[50]], [0, 2, 0], "the second row equals the first")
        self.assertEqual((rows[1:25], rows[26:50], rows[51:75]), (pixels[:24], bytes(24), bytes(24)))

    def test_small_pictures_travel_raw_and_large_ones_as_png(self) -> None:
        self.assertEqual(formats_of((56, 56))[0], "raw")
        self.assertEqual(formats_of((300, 300))[0], "png")


if __name__ == "__main__":
    unittest.main()
