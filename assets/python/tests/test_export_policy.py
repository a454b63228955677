"""A PyTorch module exported as a policy; needs torch, onnx and onnxruntime, and is skipped where they are not installed."""

import importlib.util
import json
import sys
import tempfile
import unittest
from pathlib import Path

NEEDED = ["torch", "onnx", "onnxruntime"]
HAS_ALL = all(importlib.util.find_spec(name) for name in NEEDED)
SPEC = {
    "frames": {"height": 8, "width": 8, "history": 2},
    "instruction": {"tokens": {"vocabulary": ["go", "red"], "length": 3}},
    "actions": ["left", "right"],
    "value": True,
}


@unittest.skipUnless(HAS_ALL, f"needs {', '.join(NEEDED)}")
class ExportPolicyTest(unittest.TestCase):
    def setUp(self) -> None:
        import torch
        from torch import nn

        class Policy(nn.Module):
            def __init__(self) -> None:
                super().__init__()
                self.words, self.head = nn.Embedding(4, 5), nn.Linear(6 * 64 + 5, 3)

            def forward(self, frames, tokens):  # noqa: ANN001, ANN202
                both = self.head(torch.cat([frames.flatten(1), self.words(tokens).sum(1)], 1))
                return both[:, :2], both[:, 2:]

        self.module = Policy()
        sys.path.insert(0, str(Path(__file__).parents[1]))
        import export_policy

        self.export = export_policy.export
        self.addCleanup(sys.path.pop, 0)

    def test_what_was_exported_agrees_and_is_described(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "policy.onnx"
            self.assertLess(self.export(self.module, SPEC, out), 1e-4)
            self.assertTrue(out.exists())
            told = json.loads(out.with_suffix(".json").read_text())
            self.assertEqual(told, {"format_version": 1, **SPEC})

    def test_a_module_with_other_outputs_than_described_is_refused(self) -> None:
        with tempfile.TemporaryDirectory() as folder, self.assertRaisesRegex(SystemExit, "returns 2 tensors"):
            self.export(self.module, {**SPEC, "value": False}, Path(folder) / "policy.onnx")


if __name__ == "__main__":
    unittest.main()
