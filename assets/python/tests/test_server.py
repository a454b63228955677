"""The server as a child process, with a level of BabyAI behind it."""

import json
import unittest
import urllib.error
import urllib.request

from tests.served import Served

LEVEL = "BabyAI-GoToLocal-v0"


class ServerTest(unittest.TestCase):
    def test_it_prints_one_line_serves_and_ends_with_its_standard_input(self) -> None:
        with Served("gym", LEVEL) as served:
            self.assertEqual((served.start["protocol"], served.start["version"]), ("openenv", 1))
            # Levels print on standard output when they are made; none of it comes through.
            for seed in range(20):
                served.see("reset", seed=seed)
            process = served.process
            process.stdin.close()
            self.assertEqual(process.wait(10), 0)
            self.assertEqual(process.stdout.read(), "")

    def test_connections_play_apart(self) -> None:
        with Served("gym", LEVEL) as served:
            other = served.connect()
            first = served.see("reset", seed=1)
            other.send('{"type": "state"}')
            self.assertEqual(json.loads(other.recv())["data"]["step_count"], 0)
            served.see("step", action="left")
            other.send('{"type": "reset", "data": {"seed": 1}}')
            self.assertEqual(json.loads(other.recv())["data"], first)
            other.send('{"type": "close"}')
            self.assertEqual(served.ask("state")["data"]["step_count"], 1)

    def test_pages_of_health_and_schemas_are_openenvs(self) -> None:
        with Served("gym", LEVEL) as served:
            def page(name: str) -> dict:
                address = served.start["url"].replace("ws://", "http://").removesuffix("/ws")
                with urllib.request.urlopen(f"{address}/{name}", timeout=10) as answer:
                    return json.load(answer)

            self.assertEqual(page("health"), {"status": "healthy"})
            schema = page("schema")
            self.assertEqual(set(schema), {"action", "observation", "state"})
            self.assertIn("pickup", schema["action"]["properties"]["action"]["enum"])
            with self.assertRaisesRegex(urllib.error.HTTPError, "404"):
                page("nothing")

    def test_a_message_in_pieces_and_a_ping_are_taken(self) -> None:
        with Served("gym", LEVEL) as served:
            served.socket.send(['{"type":', ' "re', 'set"}'])
            self.assertEqual(json.loads(served.socket.recv())["type"], "observation")
            self.assertTrue(served.socket.ping().wait(10))

    def test_what_cannot_be_served_is_said_at_once(self) -> None:
        for name, part in [("BabyAI-Nothing-v0", "BabyAI-Nothing-v0"), ("Pendulum-v1", "discrete set of actions")]:
            with self.assertRaisesRegex(RuntimeError, f"error: .*{part}"):
                Served("gym", name)


class OpenEnvClientTest(unittest.TestCase):
    """OpenEnv's own client, where that package is installed."""

    def test_openenvs_own_client_plays(self) -> None:
        try:
            from openenv.core.generic_client import GenericEnvClient
        except ImportError:
            self.skipTest("the package openenv is not installed")
        with Served("gym", LEVEL) as served:
            address = served.start["url"].removesuffix("/ws")
            with GenericEnvClient(base_url=address).sync() as client:
                start = client.reset(seed=5)
                self.assertFalse(start.done)
                self.assertTrue(start.observation["mission"].startswith("go to"))
                self.assertEqual(client.step({"action": "left"}).observation["frame"]["width"], 56)
                self.assertEqual(client.state()["step_count"], 1)
                with self.assertRaisesRegex(RuntimeError, "VALIDATION_ERROR"):
                    client.step({"action": "fly"})


if __name__ == "__main__":
    unittest.main()
