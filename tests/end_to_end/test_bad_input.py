"""Claims: whatever is wrong with the input, one line says what and where, nothing is half done, and
the exit code is 2.

Every case runs in a folder that holds earlier results; these must be as they were. What depends on
the environment is a process of its own, the rest calls the same entry point in this one, which
makes every warning an error.
"""

import os
import re
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import pytest

from demonstrations.emulator.emulator import EmulatedRig
from fmus.kit.build.toolchain import host_platform
from fmus.kit.errors import suggestion
from tests.support.archive import edited
from tests.support.command import here, measure, on_terminal, posix, ppy, refused

HERE = host_platform()
EARLIER = "the result of earlier work\n"
RESULTS = ("out.csv", "out.json", "out.png")


@pytest.fixture
def folder(tmp_path):
    """A folder with a good record and earlier results."""
    measure(tmp_path / "record.csv", EmulatedRig(seed=1), 200)
    for name in RESULTS:
        (tmp_path / name).write_text(EARLIER, encoding="utf-8")
    return tmp_path


def spoil(folder, change):
    """Rewrite the record by a function of its lines."""
    path = folder / "record.csv"
    path.write_text(
        "\n".join(change(path.read_text(encoding="utf-8").splitlines())) + "\n", encoding="utf-8"
    )


def with_cell(lines, row, column, text):
    """The lines with one cell replaced; row as a message counts it."""
    cells = lines[row - 1].split(",")
    cells[column] = text
    return [*lines[: row - 1], ",".join(cells), *lines[row:]]


@pytest.mark.parametrize(
    ("name", "options", "text"),
    [
        ("r1", {}, " (did you mean R1?)"),
        ("zzz", {}, " (there are: R1, voltage)"),
        ("Voltag", {"few": 0}, " (did you mean voltage?)"),
        ("zzz", {"few": 1}, ""),
    ],
)
def test_suggestions(name, options, text):
    assert suggestion(name, ["R1", "voltage"], **options) == text


# --- settings
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["--set", "Rl=1"], ["ppy_actuator", "no parameter named 'Rl'", "did you mean R"]),
        (["--set", "R1=1V"], ["R1=1V", "'V'", "'ohm'"]),
        (["--set", "R1=1furlong/hour"], ["R1", "furlong/hour", "ohm"]),
        (["--set", "R1=1 notaunit"], ["R1", "notaunit"]),
        (["--set", "R1=-0.1"], ["R1=-0.1", "-0.1 ohm is out of range", "0 … 1e+06 ohm"]),
        (["--set", "C=0F"], ["C=0F", "0 F is out of range", "1e-09 … 1e+09 F"]),
        (["--set", "R1=-1e-9ohm"], ["R1=-1e-9ohm", "out of range"]),
        (["--set", "R1=1e999"], ["R1=1e999", "inf is not a finite number"]),
        (["--set", "R1=nan"], ["R1=nan", "'nan' is not a number"]),
        (["--set", "R1"], ["'R1'", "name=value"]),
        (["--preset", "six_layer"], ["no preset named 'six_layer'", "five_layer"]),
        (["--runtime", "fortran"], ["--runtime 'fortran'", "native, python"]),
        (["--step", "0"], ["by 0 s", "--step be positive"]),
        (["--step", "-0.1"], ["by -0.1 s", "--step be positive"]),
        (["--step", "nan"], ["by nan s"]),
        (["--step", "inf"], ["by inf s"]),
        (["--step", "1e-300"], ["5e+300 steps", "at most 1e7"]),
        (["--step", "fast"], ["--step", "simulate --help"]),
        (["--stop", "0"], ["to 0 s", "--stop must come later"]),
        (["--stop", "-5"], ["to -5 s"]),
        (["--stop", "nan"], ["to nan s"]),
        (["--stop", "inf"], ["to inf s"]),
        (["--stop", "1e300"], ["1e+301 steps", "at most 1e7"]),
        (["--plot", "out.xyz"], ["out.xyz", ".png, .svg, .pdf"]),
        (["--plot", "out"], ["--plot out", "nothing"]),
        (["--map", "a=current"], ["--map", "--input"]),
        (["--input", "nothere.csv"], ["nothere.csv", "No such file"]),
        (["--nothing"], ["--nothing", "simulate --help"]),
    ],
    ids=lambda value: " ".join(value) if value and value[0].startswith("--") else "",
)
def test_simulate_refuses(folder, arguments, parts):
    results = ["--out", "out.csv", *(["--plot", "out.png"] if "--plot" not in arguments else [])]
    refused(folder, "simulate", "ppy_actuator", "--stop", 5, *results, *arguments, parts=parts)


def test_a_step_longer_than_the_simulation_is_one_step(folder):
    done = here("simulate", "ppy_actuator", "--stop", 5, "--step", "1e300", cwd=folder)
    assert done.returncode == 0
    assert "2 points from 0 s to 5 s" in done.stdout


@pytest.mark.parametrize("stop", ["-1", "0", "nan", "50"])
def test_a_stop_time_outside_the_record(folder, stop):
    arguments = ["--input", "record.csv", "--stop", stop, "--out", "out.csv"]
    refused(
        folder,
        "simulate",
        "ppy_actuator",
        *arguments,
        parts=[f"--stop {float(stop)} is not", "from 0 s to 19.9 s"],
    )


# --- names of models
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["info", "ppy_actuater"], ["ppy_actuater", "did you mean ppy_actuator"]),
        (["build", "ppy_actuater"], ["ppy_actuater", "did you mean ppy_actuator"]),
        (["simulate", "muscle"], ["no component named 'muscle'", "ppy_actuator"]),
        (["simulate", "nothere.fmu"], ["nothere.fmu", "no such file"]),
        (["simulate", "."], ["folder"]),
        (["check", "nothere.fmu"], ["nothere.fmu"]),
        (["check", "."], ["."]),
        (["check", "record.csv"], ["record.csv", "zip"]),
        (
            ["build", "ppy_actuator", "--platforms", "linux32"],
            ["--platforms linux32: there are linux64, win64, darwin64"],
        ),
        (["build", "ppy_actuator", "--runtime", "fortran"], ["'fortran'", "python, native"]),
        (["fly"], ["No such command 'fly'", "ppy --help"]),
    ],
    ids=lambda value: " ".join(value),
)
def test_names_of_nothing(folder, arguments, parts):
    refused(folder, *arguments, parts=parts)


@pytest.mark.parametrize(
    ("edit", "parts"),
    [
        (
            lambda n, c: (n.replace(f"/{HERE}/", "/win32/"), c),
            [f"no binary for {HERE}", "it has win32"],
        ),
        (
            lambda n, c: (n, c.replace(b'fmiVersion="2.0"', b'fmiVersion="3.0"')),
            ["modelDescription.xml", "no attribute instantiationToken"],
        ),
        (
            lambda n, c: (n, c.replace(b'fmiVersion="2.0"', b'fmiVersion="4.0"')),
            ["FMI version 4.0", "knows FMI 2.0"],
        ),
        (
            lambda n, c: (n, c.replace(b'fmiVersion="2.0"', b'fmiVersion="1.0"')),
            ["FMI version 1.0", "knows FMI 2.0"],
        ),
        (
            lambda n, c: None if n == "modelDescription.xml" else (n, c),
            ["not an FMU", "modelDescription.xml"],
        ),
        (lambda n, c: (n, b"\x00" * 64 if n.startswith("binaries") else c), ["cannot be loaded"]),
    ],
    ids=[
        "another platform",
        "FMI 3 by name only",
        "FMI 4",
        "FMI 1",
        "only a zip",
        "spoilt binary",
    ],
)
def test_fmus_that_cannot_run(folder, fmu, edit, parts):
    edited(fmu("ppy_actuator", "native"), folder / "other.fmu", edit)
    refused(
        folder,
        "compare",
        "record.csv",
        "--model",
        "other.fmu",
        "--out",
        "out.json",
        parts=["other.fmu", *parts],
    )


def test_an_fmu_that_is_no_zip_or_a_torn_one(folder, fmu):
    (folder / "text.fmu").write_text("not a zip\n", encoding="utf-8")
    refused(folder, "simulate", "text.fmu", parts=["text.fmu", "not an FMU"])
    (folder / "torn.fmu").write_bytes(fmu("ppy_actuator", "native").read_bytes()[:-3000])
    refused(folder, "simulate", "torn.fmu", parts=["torn.fmu", "not an FMU"])
    with zipfile.ZipFile(folder / "zip.fmu", "w") as archive:
        archive.writestr("letter.txt", "Dear reader")
    refused(folder, "check", "zip.fmu", parts=["zip.fmu", "modelDescription.xml"])


# --- records
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        (
            lambda ls: [",".join(line.split(",")[:3]) for line in ls],
            ["no column is an output", "voltage", "--map"],
        ),
        (
            lambda ls: [",".join(line.split(",")[1:]) for line in ls],
            ["no time column", "add a column of time"],
        ),
        (
            lambda ls: [
                re.sub(",[^,]*", ",nan", line, count=1) if 50 <= k < 90 else line
                for k, line in enumerate(ls)
            ],
            ["'current'", "rows 51 to 90", "40 samples", "at most 5"],
        ),
        (
            lambda ls: [*ls[:100], *ls[20:60], *ls[100:]],
            ["row 101", "jumps back", "split the file"],
        ),
        (lambda ls: [*ls, *ls[1:]], ["clock restarts", "row 201", "split the file"]),
        (
            lambda ls: [ls[0], *(re.sub("^[^,]*", "1.0", line) for line in ls[1:])],
            ["only one instant", "at least two"],
        ),
        (
            lambda ls: [ls[0].replace("[A]", "[V]"), *ls[1:]],
            ["'current'", "V cannot be converted to A"],
        ),
        (lambda ls: [ls[0].replace("[A]", "[bananas]"), *ls[1:]], ["'current'", "bananas"]),
        (
            lambda ls: with_cell(ls, 77, 3, "broken"),
            ["row 77", "'voltage'", "'broken' is not a number"],
        ),
        (lambda ls: [*ls[:40], ls[40] + ",1,2", *ls[41:]], ["row 41"]),
        (lambda ls: ls[:1], ["no complete row"]),
        (lambda ls: ls[:2], ["only one instant", "row 2"]),
        (lambda ls: ["Dear reader,", "this is a letter.", "Yours,", "truly"], ["record.csv"]),
    ],
    ids=[
        "no output",
        "no time",
        "long hole",
        "decreasing",
        "restart",
        "one instant",
        "wrong unit",
        "no unit",
        "no number",
        "more cells",
        "header only",
        "one row",
        "letter",
    ],
)
def test_records_that_cannot_be_used(folder, change, parts):
    spoil(folder, change)
    arguments = ["record.csv", "--fit", "R1", "--out", "out.json", "--plot", "out.png"]
    refused(folder, "compare", *arguments, parts=["record.csv", *parts])


@pytest.mark.parametrize(
    ("contents", "part"),
    [
        (b"", "empty"),
        (b" \n\n", "empty"),
        (bytes(range(256)) * 4, "record.csv"),
        (b"\x89PNG\r\n\x1a\n" + bytes(200), "record.csv"),
        (b"PK\x03\x04" + bytes(100), "compressed"),
    ],
    ids=["empty", "blank", "binary", "picture", "archive"],
)
def test_files_that_are_no_records(folder, contents, part):
    (folder / "record.csv").write_bytes(contents)
    refused(folder, "compare", "record.csv", "--out", "out.json", parts=["record.csv", part])


def test_a_folder_is_no_record(folder):
    refused(folder, "compare", ".", parts=["directory"])
    refused(folder, "simulate", "ppy_actuator", "--input", ".", parts=["directory"])


def test_duplicate_times_are_repaired_and_told(folder):
    spoil(folder, lambda lines: [*lines[:50], lines[49], *lines[50:]])
    done = here("compare", "record.csv", cwd=folder)
    assert done.returncode == 0
    assert "repaired: 1 rows repeat the time of an earlier row" in done.stderr


def test_a_constant_output_has_no_fit_and_that_is_said(folder):
    spoil(
        folder,
        lambda ls: [ls[0], *(",".join([*line.split(",")[:3], "1.0", "0.001"]) for line in ls[1:])],
    )
    done = here("compare", "record.csv", "--out", "figures.json", cwd=folder)
    assert done.returncode == 0
    assert "voltage: constant at 1 V throughout" in done.stderr
    assert "undefined" in done.stdout
    assert (
        "nan"
        not in done.stdout.lower() + (folder / "figures.json").read_text(encoding="utf-8").lower()
    )


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["--fit", "R1,R9"], ["no parameter named 'R9'"]),
        (["--fit", "R1,C,R1"], ["R1 is named twice"]),
        (["--fit", "current"], ["no parameter named 'current'"]),
        (["--fit", ","], ["--fit ','", "nothing before or after a comma"]),
        (["--map", "U=voltage"], ["record.csv", "no column 'U'"]),
        (["--map", "voltage=tension"], ["no signal 'tension'"]),
        (["--map", "voltage"], ["file_column=signal"]),
        (["--plot", "out.bmp"], ["out.bmp", ".png, .svg, .pdf"]),
    ],
    ids=lambda value: " ".join(value),
)
def test_compare_refuses(folder, arguments, parts):
    refused(folder, "compare", "record.csv", "--out", "out.json", *arguments, parts=parts)


def test_a_record_too_short_for_the_fit(folder):
    spoil(folder, lambda lines: [",".join(line.split(",")[:4]) for line in lines[:4]])
    arguments = ["record.csv", "--fit", "R1,R2,C", "--out", "out.json"]
    refused(
        folder, "compare", *arguments, parts=["3 parameters cannot be fitted to 3 measured values"]
    )


# --- places that cannot be written, things that are not there
# ---------------------------------------------------------


@pytest.mark.parametrize(
    "arguments",
    [
        [
            "build",
            "ppy_actuator",
            "--platforms",
            HERE,
            "--runtime",
            "python",
            "--out",
            "record.csv",
        ],
        ["simulate", "ppy_actuator", "--stop", "1", "--out", "record.csv/run.csv"],
        ["simulate", "ppy_actuator", "--stop", "1", "--plot", "record.csv/run.png"],
        ["compare", "record.csv", "--out", "record.csv/figures.json"],
        ["demo", "--out", "record.csv"],
    ],
    ids=lambda value: value[0],
)
def test_a_file_in_the_way_of_a_folder(folder, arguments):
    refused(folder, *arguments, parts=["cannot write record.csv"])


@pytest.mark.parametrize("option", ["--out", "--plot"])
@pytest.mark.parametrize(
    "command", [["simulate", "ppy_actuator"], ["compare", "record.csv"]], ids=lambda c: c[0]
)
def test_a_folder_in_the_way_of_a_file(folder, command, option):
    refused(folder, *command, option, ".", parts=[f"{option} .", "folder"])


@pytest.mark.parametrize(
    "arguments",
    [
        ["build", "ppy_actuator"],
        ["simulate", "ppy_actuator"],
        pytest.param(["demo"], marks=pytest.mark.slow),
    ],
    ids=lambda value: value[0],
)
def test_without_a_compiler(folder, arguments):
    """No ziglang, no cc: what to install is in the line."""
    (folder / "site").mkdir()
    hide = "import importlib.util as u\nold = u.find_spec\n"
    hide += "u.find_spec = lambda n, *r: None if n == 'ziglang' else old(n, *r)\n"
    (folder / "site" / "sitecustomize.py").write_text(hide, encoding="utf-8")
    paths = os.pathsep.join(filter(None, [str(folder / "site"), os.environ.get("PYTHONPATH")]))
    environment = {
        "PYTHONPATH": paths,
        "PATH": str(folder),
        "CC": "",
        "PPY_CACHE": str(folder / "cache"),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    refused(
        folder,
        *arguments,
        environment=environment,
        parts=["no C compiler for", 'pip install "ppy-rig[native]"'],
    )


@pytest.mark.slow
@posix
def test_a_path_that_is_no_utf8(folder):
    name = os.fsdecode(b"l\xe4nge.csv")
    try:
        (folder / name).write_bytes((folder / "record.csv").read_bytes())
    except OSError:
        pytest.skip("this file system takes UTF-8 names only")
    figures, picture = os.fsdecode(b"\xff.json"), os.fsdecode(b"\xff.png")
    done = ppy("compare", name, "--out", figures, "--plot", picture, cwd=folder)
    assert done.returncode == 0, done.stderr
    assert (folder / figures).stat().st_size > 100
    assert (folder / picture).stat().st_size > 1000
    done = ppy("compare", os.fsdecode(b"\xfe.csv"), cwd=folder)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith("error: \\udcfe.csv: cannot be read")


# --- the world around
# -------------------------------------------------------------------------------------------------


@posix
def test_an_interrupt_ends_a_long_simulation_at_once(folder):
    command = [
        sys.executable,
        "-m",
        "orchestration.cli",
        "simulate",
        "ppy_actuator",
        "--stop",
        "3e5",
        "--out",
        "out.csv",
    ]
    scratch = folder / "scratch"
    scratch.mkdir()
    running = subprocess.Popen(
        command,
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "TMPDIR": str(scratch)},
    )
    deadline = time.monotonic() + 60.0
    while not any(scratch.glob("ppy-fmu-*/binaries")) and time.monotonic() < deadline:
        time.sleep(0.02)
    time.sleep(0.3)
    running.send_signal(signal.SIGINT)
    printed, told = running.communicate(timeout=60)
    assert running.returncode == 130, told
    assert told.splitlines()[-1] == "interrupted"
    assert "Traceback" not in told
    assert printed == ""
    assert (folder / "out.csv").read_text(encoding="utf-8") == EARLIER
    assert list(scratch.glob("ppy-*")) == []


@posix
@pytest.mark.parametrize(
    "arguments", [["list"], ["info", "ppy_actuator"], ["simulate", "ppy_actuator"]], ids=" ".join
)
def test_a_reader_that_has_left_is_no_error(folder, arguments):
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, "-m", "orchestration.cli", *arguments]
    done = subprocess.run(command, cwd=folder, stdout=writing, stderr=subprocess.PIPE, text=True)
    os.close(writing)
    assert done.returncode in (0, 1)
    for word in ("Traceback", "Error", "error", "Exception"):
        assert word not in done.stderr


@pytest.mark.slow
@posix
def test_progress_is_a_bar_on_a_terminal_and_plain_lines_elsewhere(folder):
    command = ["simulate", "ppy_actuator", "--stop", "3000"]
    plain = ppy(*command, cwd=folder).stderr
    assert plain.splitlines() == [
        "building ppy_actuator (native) unless it is there",
        "simulating ppy_actuator",
    ]
    (folder / "scratch").mkdir(exist_ok=True)
    code, _, text = on_terminal(*command, cwd=folder)
    assert code == 0
    assert "simulating ppy_actuator" in text
    assert "━" in text  # the bar
    assert re.search(r"0:00:0\d", text)  # the time taken, or to come
    assert text.count("\x1b[?25l") == text.count("\x1b[?25h")  # the cursor is back


def test_an_internal_error_is_one_line_too_and_shows_where_on_request(folder):
    """A failure nobody foresaw: one line; PPY_DEBUG=1 gives the traceback to send along."""
    (folder / "site").mkdir()
    (folder / "site" / "sitecustomize.py").write_text(
        "from fmus.kit import registry\nregistry.models = None\n", encoding="utf-8"
    )
    paths = os.pathsep.join(filter(None, [str(folder / "site"), str(Path(__file__).parents[2])]))
    done = ppy("list", cwd=folder, environment={"PYTHONPATH": paths})
    assert done.returncode == 2
    assert re.fullmatch(
        r"error: internal error, please report: TypeError: .*PPY_DEBUG=1 shows where\)\n",
        done.stderr,
    )
    assert (
        "Traceback"
        in ppy("list", cwd=folder, environment={"PYTHONPATH": paths, "PPY_DEBUG": "1"}).stderr
    )


@pytest.mark.parametrize(
    "command", [["compare", "record.csv"], ["simulate", "ppy_actuator", "--input", "record.csv"]]
)
def test_the_record_itself_is_never_overwritten(folder, command):
    refused(
        folder, *command, "--out", "record.csv", parts=["--out record.csv", "the record itself"]
    )
    refused(folder, *command, "--out", folder / "record.csv", parts=["the record itself"])
    refused(folder, *command, "--out", "out.png", "--plot", "out.png", parts=["both name out.png"])


def test_an_input_given_twice_is_refused(folder):
    refused(
        folder,
        "compare",
        "record.csv",
        "--set",
        "current=2",
        parts=["--set current", "column for it"],
    )
