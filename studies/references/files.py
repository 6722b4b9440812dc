"""A reference result as it is written, in the form of the FMI cross-check.

``NAME_in.csv`` has the inputs, ``NAME_ref.csv`` the outputs, ``NAME_ref.opt`` how they were made. A
repeated time marks a jump.
"""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

Row = Sequence[float]
COMPONENTS = Path(__file__).parents[2] / "fmus"


class Reference:
    """Rows of inputs and of outputs; of a jump, both those just before it and those just after it.

    Parameters
    ----------
    name : str
        Of the component.
    inputs, outputs : iterable of str
        Names of the columns after the time.
    step : float
        Between communication points, s.
    """

    def __init__(self, name: str, inputs: Iterable[str], outputs: Iterable[str], step: float):
        self.name = name
        self.step = step
        self._names = {"in": tuple(inputs), "ref": tuple(outputs)}
        self._rows: dict[str, list[Row]] = {"in": [], "ref": []}
        self._held: list[float] | None = None

    def add(self, time: float, inputs: Row, outputs: Callable[[Row], Row]) -> None:
        """Add a communication point.

        Parameters
        ----------
        time : float
            s.
        inputs : sequence of float
            From here on, SI.
        outputs : callable
            Of the inputs, for those before the jump and those after it.
        """
        now = [*inputs]
        if self._held != now:
            if self._held is not None:
                self._rows["in"].append([time, *self._held])
                self._rows["ref"].append([time, *outputs(self._held)])
            self._rows["in"].append([time, *now])
        self._rows["ref"].append([time, *outputs(now)])
        self._held = now

    def write(self, folder: str, stop: float, solver: str, *, ends_held: bool = True) -> None:
        """Write the three files into the folder ``reference`` of a component.

        Parameters
        ----------
        folder : str
            Of the component in ``fmus``.
        stop : float
            Stop time, s.
        solver : str
            What computed it.
        ends_held : bool
            Whether a row at the stop time holds the last inputs; not where they jump there.
        """
        out = COMPONENTS / folder / "reference"
        if ends_held:
            self._rows["in"].append([stop, *(self._held or ())])
        for suffix, names in self._names.items():
            lines = [",".join(("time", *names))]
            lines += [",".join(f"{v:.12g}" for v in row) for row in self._rows[suffix]]
            write_lines(out / f"{self.name}_{suffix}.csv", lines)
        write_options(out / f"{self.name}_ref.opt", stop, self.step, solver)


def write_options(path: Path, stop: float, step: float, solver: str) -> None:
    """Write how a reference result was made.

    Parameters
    ----------
    path : Path
        Of the file.
    stop, step : float
        Stop time and step of the rows, s.
    solver : str
        What computed it.
    """
    options = {
        "StartTime": 0,
        "StopTime": stop,
        "StepSize": step,
        "RelTol": 1e-7,
        "AbsTol": 1e-9,
        "SolverType": solver,
        "OutputIntervalLength": step,
    }
    write_lines(path, [f"{key},{value}" for key, value in options.items()])


def write_lines(path: Path, lines: Iterable[str]) -> None:
    """Write lines that end alike on every platform."""
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
