"""Looks for inputs that do something new, and for ones that break something; keeps both in the corpus.

python tests/stress/fuzz.py --seconds 600                  all targets share them; adds to tests/stress/corpus/
python tests/stress/fuzz.py --target edits                 only this one
python tests/stress/fuzz.py --target edits --replay HEX    one input once more
python tests/stress/fuzz.py --thin                         drops kept inputs that show nothing that shorter ones do not

An input is any bytes: a target reads them as calls of the engine and judges each answer. New is a line of the engine's
Python face that no kept input reaches, a refusal in other words, a commit's action, builder or reason that none shows.
Inputs are made by changing, joining and cutting kept ones. One that fails is kept as well, and ends the search.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

if __name__ == "__main__":
    TESTS = Path(__file__).resolve().parent.parent
    sys.path[:0] = [str(TESTS), str(TESTS.parent / "blend_scenes")]

import numpy as np

from stress.boundary import cast_rays, compute_closest_points, fill_scenes
from stress.bytes import Features
from stress.edits import edit_scenes
from stress.hard_meshes import trace_hard_mesh
from stress.reached_lines import with_lines
from stress.round_boundary import fill_with_curves_and_points

CORPUS = Path(__file__).parent / "corpus"
LONGEST = 160
TARGETS: dict[str, Callable[[bytes], Features]] = {
    "edits": edit_scenes,
    "hard_mesh": trace_hard_mesh,
    "rays": cast_rays,
    "closest_points": compute_closest_points,
    "meshes_and_instances": fill_scenes,
    "curves_and_points": fill_with_curves_and_points,
}


def read_corpus(target: str) -> list[bytes]:
    """The kept inputs, the oldest first."""
    path = CORPUS / f"{target}.txt"
    return [bytes.fromhex(line) for line in path.read_text(encoding="ascii").split()] if path.is_file() else []


def run(target: str, data: bytes) -> Features:
    """The features of an input. Raises AssertionError, which says how to replay it, if it breaks something."""
    try:
        return with_lines(TARGETS[target], data)
    except Exception as failure:
        replay = f"python tests/stress/fuzz.py --target {target} --replay {data.hex()}"
        raise AssertionError(replay) from failure


def mutated(corpus: list[bytes], random: np.random.Generator) -> bytes:
    """Some kept input, changed a little: bytes set, cut out, repeated, another one appended; now and then any bytes."""
    if not corpus or random.random() < 0.1:
        return random.bytes(int(random.integers(1, LONGEST)))
    data = bytearray(corpus[random.integers(len(corpus))])
    for _ in range(1 + random.integers(4)):
        at, length = int(random.integers(len(data) + 1)), int(random.integers(1, 9))
        kind = random.integers(4)
        if kind == 0:
            data[at : at + length] = random.bytes(length)
        elif kind == 1 and len(data) > length:
            del data[at : at + length]
        elif kind == 2:
            data[at:at] = data[at : at + length] or random.bytes(length)
        else:
            data += corpus[random.integers(len(corpus))]
    return bytes(data[:LONGEST]) or b"\0"


def search(target: str, seconds: float, seed: int) -> None:
    corpus, tried, kept_count = read_corpus(target), 0, 0
    known: Features = set().union(*(run(target, data) for data in corpus))
    random = np.random.default_rng(seed)
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        data, tried = mutated(corpus, random), tried + 1
        try:
            new = run(target, data) - known
        except BaseException:
            keep(target, data)
            raise
        if new:
            known |= new
            corpus.append(data)
            keep(target, data)
            kept_count += 1
    print(f"{target}: {tried} inputs tried, {kept_count} kept of them, {len(corpus)} in all, {len(known)} features")


def thin(target: str) -> None:
    """Rewrites the corpus: the shortest inputs first, each kept only if it adds something."""
    known: Features = set()
    kept = []
    for data in sorted(read_corpus(target), key=lambda data: (len(data), data)):
        features = run(target, data)
        if features - known:
            known |= features
            kept.append(data)
    (CORPUS / f"{target}.txt").write_text("".join(f"{data.hex()}\n" for data in kept), encoding="ascii")
    print(f"{target}: {len(kept)} kept, {len(known)} features")


def keep(target: str, data: bytes) -> None:
    CORPUS.mkdir(exist_ok=True)
    with (CORPUS / f"{target}.txt").open("a", encoding="ascii") as file:
        file.write(f"{data.hex()}\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--target", choices=TARGETS, help="default: all, one after the other")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=None, help="default: another one each time")
    parser.add_argument("--replay", metavar="HEX", help="one input of the target, once")
    parser.add_argument("--thin", action="store_true", help="drop what adds nothing")
    options = parser.parse_args()
    if options.replay is not None:
        if options.target is None:
            parser.error("--replay needs --target")
        print(sorted(TARGETS[options.target](bytes.fromhex(options.replay))))
        return
    targets = list(TARGETS) if options.target is None else [options.target]
    for target in targets:
        if options.thin:
            thin(target)
        else:
            search(target, options.seconds / len(targets), options.seed)


if __name__ == "__main__":
    main()
