"""FMUs that crash, hang, end their process and the like, compiled from C: what each does, and what
it looks like.
"""

from __future__ import annotations

import subprocess
import tempfile
import zipfile
from pathlib import Path

import fmpy

from tests.support.hosts import HEADERS, ONE_STATE_DESCRIPTION, TESTS, compiler

STEP, READING, START, END = "AT_STEP", "AT_READING", "AT_START", "AT_END"
# what is not in every test: what a process is allowed is taken away, which not every run needs
TAKEN = {
    "lets_nobody_write": (STEP, "allow_none(RLIMIT_FSIZE)", ""),
    "lets_nobody_open": (STEP, "allow_none(RLIMIT_NOFILE)", ""),
}
# by name: where, what, and a part of the line in which it is told; empty where the run can be
# finished
ACTS = {
    "exits": (STEP, "exit(0)", "exit status 0"),
    "exits_3": (STEP, "exit(3)", "exit status 3"),
    "exits_at_once": (STEP, "_exit(0)", "exit status 0"),
    "aborts": (STEP, "abort()", "SIGABRT"),
    "writes_to_nothing": (STEP, "*(volatile int *)8 = 1", "SIGSEGV"),
    "divides_by_nothing": (STEP, "raise(SIGFPE)", "SIGFPE"),
    "kills_itself": (STEP, "kill(getpid(), SIGKILL)", "SIGKILL"),
    "terminates_itself": (STEP, "raise(SIGTERM)", "SIGTERM"),
    "hangs": (STEP, "hang()", "no answer within"),
    "sleeps": (STEP, "rest()", "no answer within"),
    "hangs_deaf": (STEP, "deaf()", "no answer within"),
    "takes_all_memory": (STEP, "take_memory()", "ended by SIG"),
    "recurses": (STEP, "recurse(0)", "SIGSEGV"),
    "damages_the_heap": (STEP, "damage_heap()", "SIG"),
    "is_fatal": (STEP, "return fmi2Fatal", "(fatal)"),
    "is_pending_for_ever": (STEP, "return fmi2Pending", "(pending)"),
    "crashes_as_it_is_read": (READING, "*(volatile int *)8 = 1", "SIGSEGV"),
    "exits_as_it_is_read": (READING, "exit(0)", "exit status 0"),
    "crashes_as_it_begins": (START, "*(volatile int *)8 = 1", "SIGSEGV"),
    "exits_as_it_begins": (START, "exit(0)", "exit status 0"),
    "hangs_as_it_begins": (START, "hang()", "no answer within"),
    "crashes_as_it_is_freed": (END, "*(volatile int *)8 = 1", "SIGSEGV"),
    "hangs_as_it_is_freed": (END, "hang()", "no answer within"),
    "changes_the_folder": (STEP, 'if (chdir("/")) abort()', ""),
    "prints_much": (STEP, "if (time < 1.05) print_much()", ""),
    "closes_every_file": (STEP, "close_from(0)", "process ended"),
    "closes_files_and_hangs": (STEP, "(close_from(3), rest())", "did not answer any more"),
    "becomes_another_program": (
        STEP,
        'execl("/bin/sleep", "sleep", "300", NULL)',
        "did not answer any more",
    ),
    "leaves_a_process": (STEP, "if (time < 1.05) leave_process()", ""),
    "leaves_a_process_and_aborts": (STEP, "(leave_process(), abort())", "SIGABRT"),
    "returns_twice": (STEP, "if (time < 1.05) fork()", ""),
    "writes_to_every_file": (
        STEP,
        "if (time < 1.05) write_everywhere()",
        "did not answer any more",
    ),
    "returns_no_status": (STEP, "return -1", "(status -1)"),
    "sends_orders_to_the_terminal": (STEP, "return order(c)", r"(error): \x1b[2J and more"),
}


def build(name: str, directory: Path) -> Path:
    """Compile an FMU that does this act."""
    where, what, _ = (ACTS | TAKEN)[name]
    path = directory / f"{name}.fmu"
    with tempfile.TemporaryDirectory(prefix="misbehaving_") as folder:
        library = Path(folder, "one_state.so")
        honest = (TESTS / "c" / "one_state.c").read_text()
        for function in ("DoStep", "GetReal", "Instantiate", "FreeInstance"):
            honest = honest.replace(f"fmi2{function}(", f"honest_{function}(")
        Path(folder, "honest.c").write_text(honest)
        command = [
            compiler(),
            "-std=c99",
            "-O1",
            "-fPIC",
            "-shared",
            "-w",
            f"-I{HEADERS}",
            f"-I{folder}",
        ]
        command.append(f"-D{where}={what}")
        command += [str(TESTS / "c" / "misbehaving.c"), "-o", str(library), "-lm", "-lpthread"]
        subprocess.run(command, check=True, capture_output=True)
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("modelDescription.xml", ONE_STATE_DESCRIPTION)
            archive.write(library, f"binaries/{fmpy.platform}/one_state.so")
    return path
