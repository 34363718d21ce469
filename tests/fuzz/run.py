"""Runs many mutations of each target of `targets.py`, and prints those that `baker` handles wrongly.

python tests/fuzz/run.py                     # 1000 mutations of each scene for each target
python tests/fuzz/run.py bake fix --count 50 --seed 7
python tests/fuzz/run.py bake --scene 2 --only 7123

With NUMBA_BOUNDSCHECK=1, kernels check every index. Set NUMBA_CACHE_DIR to a separate folder then, because
these kernels are compiled differently. Each scene of a target runs in a separate process, which is started
again after a mutation that kills it.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from targets import ANSWERS, TARGETS, scenes_of

# Longest permitted processor time of the run with one mutation, seconds. A mutation whose run takes longer is
# reported. Elapsed time also depends on other programs.
LONGEST = 60.0


def run_here(name: str, scene: int, seeds: range) -> int:
    """Run mutations in this process, print each seed before it runs, and return the number of failures."""
    failures = 0
    with tempfile.TemporaryDirectory() as folder:
        for seed in seeds:
            print(f"seed {seed}", flush=True)
            begin = time.process_time()
            found = TARGETS[name](scenes_of(name)[scene], Path(folder), np.random.default_rng(seed))
            if found is None and time.process_time() - begin > LONGEST:
                found = f"took {time.process_time() - begin:.0f} s of processor time"
            if found is not None:
                failures += 1
                print(f"wrong {name} --scene {scene} --only {seed}\n{found}", flush=True)
    return failures


def run_apart(name: str, scene: int, seeds: range) -> int:
    """Run mutations in a separate process, print the failures, and return their number."""
    failures, first = 0, seeds.start
    while first < seeds.stop:
        command = [sys.executable, __file__, name, "--scene", str(scene), "--seed", str(first)]
        command += ["--count", str(seeds.stop - first), "--here"]
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        ) as process:
            last = first
            for line in process.stdout or ():
                if line.startswith("seed "):
                    last = int(line.split()[1])
                elif not line.startswith("done"):
                    failures += line.startswith("wrong ")
                    print(line, end="", flush=True)
        if process.returncode in (0, 1):
            break
        failures += 1
        print(f"killed by {process.returncode}: {name} --scene {scene} --only {last}", flush=True)
        first = last + 1
    return failures


def main() -> int:
    """Run the targets of the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("targets", nargs="*", default=list(TARGETS), help=", ".join(TARGETS))
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--scene", type=int)
    parser.add_argument("--only", type=int, help="one seed, in this process")
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    seeds = range(given.seed, given.seed + given.count)
    seeds = seeds if given.only is None else range(given.only, given.only + 1)
    run = run_here if given.here or given.only is not None else run_apart
    failures = 0
    for name in given.targets:
        for scene in range(len(scenes_of(name))) if given.scene is None else [given.scene]:
            failures += run(name, scene, seeds)
    if run is run_here:
        print(f"{' '.join(given.targets)}: " + ", ".join(f"{n} {name}" for name, n in ANSWERS.items()))
    print(f"done: {failures} wrong answers")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
