"""How long a task of 200 requirements takes to parse and check, next to `import gymnasium`.

Each figure is processor time, that of the fastest of several fresh processes. The task's figure
holds the import of the parser, the construction of its tables and the task with all its checks;
the first margins, which import NumPy and compile, are shown apart.
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


def fastest(code: str, text: str, repeats: int) -> list[float]:
    """Seconds of each part in the fresh process with the smallest sum."""
    runs: list[list[float]] = []
    for _ in range(repeats):
        process = subprocess.run(
            [sys.executable, "-W", "ignore", "-c", code],
            input=text,
            capture_output=True,
            text=True,
            check=True,
        )
        runs.append([float(part) for part in process.stdout.split()])
    return min(runs, key=sum)


def main() -> None:
    """Print both times and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--requirements", type=int, default=200)
    parser.add_argument("--repeats", type=int, default=7)
    arguments = parser.parse_args()
    text = task_text(arguments.requirements)
    (bare,) = fastest(_GYMNASIUM, "", arguments.repeats)
    parts = fastest(_PARSE, text, arguments.repeats)
    names = ("import the parser", "build its tables", "parse and check")
    whole = sum(parts[:3])
    print(f"import gymnasium          {1e3 * bare:7.1f} ms")
    print(f"task of {arguments.requirements} requirements  {1e3 * whole:7.1f} ms, of which")
    for name, part in zip(names, parts, strict=False):
        print(f"  {name:22}  {1e3 * part:7.1f} ms")
    print(f"its first margins         {1e3 * parts[3]:7.1f} ms")
    print(f"task / gymnasium          {whole / bare:7.2f}    (wanted: at most 2)")


if __name__ == "__main__":
    main()
