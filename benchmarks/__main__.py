"""Measure everything, print the tables and write ``docs/benchmarks.md``."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from . import diagnosing, models, reading, stepping, sweeping, systems
from .tables import DOCS, Table, Topic, publish

PAGE = DOCS / "benchmarks.md"


@dataclass(frozen=True)
class Benchmark:
    """A topic of the page.

    Attributes
    ----------
    title : str
    timed : str
        The work that is measured.
    against : str
        The yardstick of the ratios; empty where there is none.
    parts : callable
        Measures, in a tiny form if asked to; yields paragraphs and tables.
    """

    title: str
    timed: str
    against: str
    parts: Callable[[bool], Iterator[str | Table]]

    def measure(self, quick: bool = False) -> Topic:
        """Measure, and return a section of the page."""
        text = f"{self.timed} Held against {self.against}." if self.against else self.timed
        return Topic(self.title, [text, *self.parts(quick)])


TOPICS = {
    "step": Benchmark(
        "Co-simulation step",
        "`setReal`, `doStep` (0.1 s), `getReal`, one variable each, with another input in each"
        " step. The actuator has three states and controls its error (at least five evaluations of"
        " the rates in a step); the FMUs it is held against have one state and no error control.",
        "an FMU of one state by hand in C; the smallest slave of stock pythonfmu; and the floor, an"
        " FMU whose functions return at once, which is the time of the host alone",
        stepping.step,
    ),
    "fmi3": Benchmark(
        "FMI 3.0 beside 2.0",
        "A step by the stepping kernel with one input set and all outputs read; opening, starting"
        " and closing an FMU; and setting and reading all elements of an array.",
        "the build of the same component for FMI 2.0",
        stepping.versions,
    ),
    "kernel": Benchmark(
        "Stepping kernel",
        "A step of `ppy simulate`, with one input set and one output read and kept, without opening"
        " the FMU.",
        "a bare loop in C, which calls the same functions and does nothing else, and the loop in"
        " Python that runs where there is no compiler; all come to the same bits",
        stepping.kernel,
    ),
    "record": Benchmark(
        "Simulation of a record",
        "`ppy_actuator` over a record at 10 Hz: square waves of current, staircases of load.",
        "CasADi's VM, which takes one step of the Runge-Kutta method for each sample, without error"
        f" estimate; all signals agree to {models.AGREEMENT:g} of the largest value. Eight"
        " sensitivities by differences would take nine runs",
        models.record,
    ),
    "stiff": Benchmark(
        "Stiff components",
        "Records at 100 Hz, inputs held at changing levels, sensitivities included; the galvanostat"
        " with a lag of 0.1 ms.",
        "the Runge-Kutta method of the FMUs",
        models.stiff,
    ),
    "ageing": Benchmark(
        "The life of five hours",
        "Cycling with a step of 0.1 s: galvanostat, ageing actuator and degradation estimator, as"
        " native FMUs in one process under our master (Jacobi); 18 values are set or read at each"
        " step, and 12 are recorded. Opening the FMUs counts too.",
        "real time",
        systems.life,
    ),
    "master": Benchmark(
        "Co-simulation masters",
        "A step (0.001 s) of a bench that pulls at an actuator, native FMUs in an SSP file, without"
        " opening and initialization. In the first table ours keeps one signal and exchanges values"
        " as the others do (`feedthrough=False`); in the second ours and libcosim record in memory,"
        " Ecos in a CSV file, for want of another place.",
        "libcosim and Ecos on the same FMUs in one process; all come to the same position",
        systems.masters,
    ),
    "pacing": Benchmark(
        "Real time",
        "How much later than its deadline each communication point is reached; deadlines are"
        " absolute. The master sleeps a little less than it must and spins for the rest.",
        "a bare loop that computes nothing and sleeps until the same deadlines",
        systems.pacing,
    ),
    "sweeps": Benchmark(
        "Sweeps",
        "A case of 1,000 steps with one input set at every point, another value of a parameter, and"
        " the last, smallest and largest value of an output kept; with all that it takes to begin.",
        "`fmpy.simulate_fmu` in a loop; all agree to 1e-9",
        sweeping.sweeps,
    ),
    "isolation": Benchmark(
        "Isolation",
        "`ppy.simulate` with one input set at every point, of an FMU in a process of its own; 10 µs"
        " more for a step are aimed at.",
        "the same in this process",
        stepping.isolation,
    ),
    "diagnose": Benchmark(
        "Naming a cause",
        "`ppy.diagnose` of records at 10 Hz of an emulated rig whose strain saturates, models"
        " compiled before; the peak is the memory of the whole process.",
        "the time that is aimed at",
        diagnosing.causes,
    ),
    "laws": Benchmark(
        "A search of the laws",
        "The same without the catalogue of effects, so that the laws are searched for the cause.",
        "",
        diagnosing.laws,
    ),
    "text": Benchmark(
        "Text tables",
        "Files of 3 million numbers with a header: the table of one, and a record, with its units,"
        " repairs and notices.",
        "`pandas.read_csv` on the same file; all come to the same bits",
        reading.tables,
    ),
    "import": Benchmark(
        "Start of the command line",
        "Commands, each in a process of its own.",
        "a Python that does nothing",
        models.start,
    ),
    "build": Benchmark(
        "Building an FMU",
        "`ppy_actuator` for this machine. Sources lie in a new folder each time, so that the"
        " compiler remembers nothing of them. The native build also brings its sources.",
        "compiling an empty C FMU",
        models.builds,
    ),
    "size": Benchmark(
        "Size of the product",
        "Nodes of the syntax trees and lines of `orchestration` and `fmus`, by room.",
        "",
        models.size,
    ),
}
_HEAD = """# Benchmarks

Written by `make benchmark` (`python -m benchmarks`). Times depend on the machine; ratios depend on
it much less. Everything that is compared was measured in one run, in turns. *Best* is the shortest
time, the one least disturbed; a *median ratio* is the median over the rounds of the ratio within
one round, and a target is the largest that is aimed at. [Hidden and clean
records](hidden-records.md) tell how long hundreds of diagnoses take."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument(
        "topics", nargs="*", metavar="topic", help=f"of {', '.join(TOPICS)}; default all"
    )
    parser.add_argument(
        "--quick", action="store_true", help="tiny runs, to see that everything works; no page"
    )
    parser.add_argument(
        "--out", type=Path, help="page to write; default docs/benchmarks.md after a full run of all"
    )
    chosen = parser.parse_args(arguments)
    unknown = [name for name in chosen.topics if name not in TOPICS]
    if unknown:
        parser.error(f"unknown topic {unknown[0]!r}; there are: {', '.join(TOPICS)}")
    page = chosen.out or (None if chosen.quick or chosen.topics else PAGE)
    topics = [TOPICS[name].measure(chosen.quick) for name in chosen.topics or TOPICS]
    publish(_HEAD, topics, page)


if __name__ == "__main__":
    main()
