# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m tests.fuzz``: changed inputs must end in a result or in a named error.

Each case forks this process, changes one of the small inputs, and runs the command line on it. A
case fails if a traceback is printed, a signal ends it, or it takes more than its processor time or
memory. It depends on the seed and its number alone: ``--only NUMBER`` repeats one.
"""

from __future__ import annotations

import argparse
import collections
import sys
import tempfile
import time
from pathlib import Path

from .cases import CPU_S, MEMORY_BYTES, Case, run_case
from .corpus import make_corpus


def main() -> int:
    """Run the cases and print those that fail."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz")
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--only", type=int, help="one case alone, with its output")
    chosen = parser.parse_args()
    numbers = range(chosen.first, chosen.first + chosen.cases)
    if chosen.only is not None:
        numbers = range(chosen.only, chosen.only + 1)
    began_s, failed, codes = time.monotonic(), 0, collections.Counter[int]()
    worst_s, worst_bytes = 0.0, 0
    with tempfile.TemporaryDirectory(prefix="fuzz-") as name:
        make_corpus(Path(name) / "corpus")
        for number in numbers:
            case: Case = run_case(Path(name), chosen.seed, number)
            codes[case.code] += 1
            worst_s, worst_bytes = max(worst_s, case.cpu_s), max(worst_bytes, case.peak_bytes)
            if case.fault or chosen.only is not None:
                failed += bool(case.fault)
                print(f"case {number}: {case.fault or 'passed'}\n  {case.words}\n  {case.changed}")
                print("  | " + case.output[-2500:].replace("\n", "\n  | "), flush=True)
    print(
        f"{len(numbers)} cases, seed {chosen.seed}: {failed} failed; exit codes "
        f"{dict(sorted(codes.items()))}; at most {worst_s:.1f} of {CPU_S} s and "
        f"{worst_bytes / 2**20:.0f} of {MEMORY_BYTES / 2**20:.0f} MiB; "
        f"{time.monotonic() - began_s:.0f} s"
    )
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
