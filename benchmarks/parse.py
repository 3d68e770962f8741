"""How long a task of 200 requirements takes to its first margins, next to `import gymnasium`.

Each figure is processor time, the smallest of several fresh processes; the two kinds of process
take turns, so that other work on the machine hits both. The task's figure holds the imports (NumPy
among them, which Gymnasium imports as well), the construction of the parser's tables, the task with
all its checks, and the compilation of its margins.
"""

from __future__ import annotations

import argparse
import subprocess
import sys

_GYMNASIUM = """
import time
start = time.process_time()
import gymnasium
print(time.process_time() - start)
"""
_PARSE = """
import sys, time
text = sys.stdin.read()
start = time.process_time()
from hprs.spec.parser import parse_task
imported = time.process_time()
parse_task("")
built = time.process_time()
task = parse_task(text)
parsed = time.process_time()
task.margins({signal.name: 0.5 for signal in task.signals})
print(imported - start, built - imported, parsed - built, time.process_time() - parsed)
"""


def task_text(count: int) -> str:
    """A task of so many requirements of every shape, over 50 signals and 20 definitions."""
    lines = [f'signal x{i} = obs[{i}] in [-{i + 1}, {i + 1}] "m"' for i in range(50)]
    lines += [f"const limit{i} = {i} deg + 0.5" for i in range(10)]
    lines += [f"let d{i} = hypot(x{i} - 0.25, x{i + 1} / 2) + abs(x{i + 2})" for i in range(20)]
    shapes = (
        "abs(x{a}) <= limit{c}",
        "-0.5 <= x{a} - x{b} < 12 deg + limit{c}",
        "(d{d} <= 1.5 or x{a} > 0.1) and clip(x{b}, -1, 1) ** 2 <= 0.9",
        "max(x{a}, x{b}, d{d}) * 2 - limit{c} / 3 <= sqrt(1 + x{a} * x{a})",
    )
    for i in range(count):
        kind = "conquer" if i == 0 else "ensure" if i % 2 else "encourage"
        shape = shapes[i % len(shapes)].format(a=i % 50, b=(7 * i + 3) % 50, c=i % 10, d=i % 20)
        lines.append(f"{kind} r{i}: {shape}")
    return "\n".join(lines) + "\n"


def seconds(code: str, text: str) -> list[float]:
    """Seconds of each part in a fresh process."""
    process = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code],
        input=text,
        capture_output=True,
        text=True,
        check=True,
    )
    return [float(part) for part in process.stdout.split()]


def main() -> None:
    """Print both times and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--requirements", type=int, default=200)
    parser.add_argument("--repeats", type=int, default=15)
    arguments = parser.parse_args()
    text = task_text(arguments.requirements)
    pairs = [(seconds(_GYMNASIUM, ""), seconds(_PARSE, text)) for _ in range(arguments.repeats)]
    bare = min(bare for (bare,), _ in pairs)
    parts = min((parts for _, parts in pairs), key=sum)
    names = ("import the parser", "build its tables", "parse and check", "first margins")
    print(f"import gymnasium          {1e3 * bare:7.1f} ms")
    print(f"task of {arguments.requirements} requirements  {1e3 * sum(parts):7.1f} ms, of which")
    for name, part in zip(names, parts, strict=True):
        print(f"  {name:22}  {1e3 * part:7.1f} ms")
    print(f"task / gymnasium          {sum(parts) / bare:7.2f}    (wanted: at most 2)")


if __name__ == "__main__":
    main()
