"""Exports a PyTorch module as a policy for `sprint --policy onnx:FILE`: FILE.onnx, and FILE.json that says what goes in and
comes out (`sprint schema policy`). The exported file is computed beside the module, and must agree.

    python export_policy.py MODULE.py:FUNCTION SPEC.json OUT.onnx [--weights WEIGHTS.pt]

FUNCTION returns the module. Its forward takes what the description asks for, in its order: frames, then tokens or
instruction; it returns the logits of actions, then of arguments and the value where the description has them. Needs the
packages torch and onnx, and onnxruntime for the comparison.
"""

import argparse
import importlib.util
import json
from pathlib import Path

import torch

#: How far an output may be off, relative to the largest number of it.
TOLERANCE = 1e-4


def examples(spec, batch):
    """Inputs by name as the description has them, made by chance."""
    frames = spec["frames"]
    size = (batch, 3 * frames.get("history", 1), frames["height"], frames["width"])
    inputs = {"frames": torch.rand(size)}
    instruction = spec.get("instruction") or {}
    if tokens := instruction.get("tokens"):
        inputs["tokens"] = torch.randint(0, len(tokens["vocabulary"]) + 2, (batch, tokens["length"]))
    if embedding := instruction.get("embedding"):
        inputs["instruction"] = torch.randn(batch, embedding["size"])
    return inputs


def output_names(spec):
    """The outputs that the description has, in its order."""
    return ["actions"] + (["arguments"] if spec.get("arguments") else []) + (["value"] if spec.get("value") else [])


def tuple_of(outputs):
    """A module may return one tensor by itself."""
    return outputs if isinstance(outputs, tuple | list) else (outputs,)


def export(module, spec, path):
    """Writes the module and its description; returns the largest relative difference between both."""
    import onnxruntime

    path = Path(path)
    module = module.eval().cpu()
    inputs, names = examples(spec, 1), output_names(spec)
    with torch.no_grad():
        outputs = tuple_of(module(*inputs.values()))
    if len(outputs) != len(names):
        raise SystemExit(f"the module returns {len(outputs)} tensors, and its description has {', '.join(names)}")
    axes = {name: {0: "batch"} for name in [*inputs, *names]}
    torch.onnx.export(
        module,
        tuple(inputs.values()),
        str(path),
        input_names=list(inputs),
        output_names=names,
        dynamic_axes=axes,
        opset_version=17,
        dynamo=False,
    )
    path.with_suffix(".json").write_text(json.dumps({"format_version": 1, **spec}, indent=1) + "\n")
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    worst = 0.0
    for batch in (1, 1, 3):
        inputs = examples(spec, batch)
        with torch.no_grad():
            wanted = tuple_of(module(*inputs.values()))
        found = session.run(names, {name: value.numpy() for name, value in inputs.items()})
        for name, one, other in zip(names, wanted, found, strict=True):
            off = (one - torch.from_numpy(other)).abs().max() / one.abs().max().clamp(min=1.0)
            if not off <= TOLERANCE:
                raise SystemExit(f"{path}: its output {name} is off by {off:.2g} of its largest number")
            worst = max(worst, float(off))
    return worst


def load(reference):
    """What a function of a file returns, from FILE.py:FUNCTION."""
    file, _, function = reference.partition(":")
    found = importlib.util.spec_from_file_location("exported", file)
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return getattr(module, function)()


def main():
    """Exports what the command line names."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("module", metavar="MODULE.py:FUNCTION")
    parser.add_argument("spec", metavar="SPEC.json")
    parser.add_argument("out", metavar="OUT.onnx")
    parser.add_argument("--weights", metavar="WEIGHTS.pt", help="a state dictionary for the module")
    chosen = parser.parse_args()
    module = load(chosen.module)
    if chosen.weights:
        module.load_state_dict(torch.load(chosen.weights, map_location="cpu", weights_only=True))
    off = export(module, json.loads(Path(chosen.spec).read_text()), chosen.out)
    print(f"wrote {chosen.out}; it agrees with the module to {off:.1g}")


if __name__ == "__main__":
    main()
