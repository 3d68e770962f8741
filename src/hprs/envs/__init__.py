"""The benchmarks: environments with their task files. Importing this registers them."""

from hprs.envs.registration import BENCHMARKS as BENCHMARKS
from hprs.envs.registration import Benchmark as Benchmark
from hprs.envs.registration import register as register
from hprs.envs.registration import task_of as task_of
from hprs.envs.registration import task_text_of as task_text_of

__all__ = ["BENCHMARKS", "Benchmark", "register", "task_of", "task_text_of"]

register()
