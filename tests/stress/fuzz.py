"""Looks for series of edits that do something new, and for ones that break something; keeps both in the corpus.

python tests/stress/fuzz.py --seconds 600       what does something new is added to tests/stress/corpus.txt
python tests/stress/fuzz.py --replay HEX        plays one series again
python tests/stress/fuzz.py --thin              drops from the corpus what shows nothing that shorter series do not

New: a commit's action, builder or reason, a refusal, a top level that no kept series has shown. Series are made by
changing, joining and cutting kept ones. One that fails is printed, kept as well, and ends the search.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np

from stress.edits import Play

CORPUS = Path(__file__).parent / "corpus.txt"
LONGEST = 160


def read_corpus() -> list[bytes]:
    """The kept series, the oldest first."""
    return [bytes.fromhex(line) for line in CORPUS.read_text(encoding="ascii").split()]


def mutated(corpus: list[bytes], random: np.random.Generator) -> bytes:
    """Some kept series, changed a little: bytes set, cut out, repeated, or another series appended."""
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


def search(seconds: float, seed: int) -> None:
    corpus, random = read_corpus(), np.random.default_rng(seed)
    known = set().union(*(Play(data).run() for data in corpus))
    until, tried = time.monotonic() + seconds, 0
    while time.monotonic() < until:
        data, tried = mutated(corpus, random), tried + 1
        try:
            new = Play(data).run() - known
        except BaseException:
            print(f"fails: --replay {data.hex()}")
            keep(data)
            raise
        if new:
            known |= new
            corpus.append(data)
            keep(data)
            print(f"{len(data)} bytes: {sorted(new)}")
    print(f"{tried} series tried, {len(corpus)} kept, {len(known)} features")


def thin() -> None:
    """Rewrites the corpus: the shortest series first, each kept only if it adds something."""
    known: set[tuple[str, ...]] = set()
    kept = []
    for data in sorted(read_corpus(), key=len):
        features = Play(data).run()
        if features - known:
            known |= features
            kept.append(data)
    CORPUS.write_text("".join(f"{data.hex()}\n" for data in kept), encoding="ascii")
    print(f"{len(kept)} kept, {len(known)} features")


def keep(data: bytes) -> None:
    with CORPUS.open("a", encoding="ascii") as file:
        file.write(f"{data.hex()}\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=None, help="default: another one each time")
    parser.add_argument("--replay", metavar="HEX", help="one series of edits, played once")
    parser.add_argument("--thin", action="store_true", help="drop what adds nothing")
    options = parser.parse_args()
    if options.thin:
        thin()
    elif options.replay is not None:
        print(sorted(Play(bytes.fromhex(options.replay)).run()))
    else:
        search(options.seconds, options.seed)


if __name__ == "__main__":
    main()
