"""Measured records: any file of a rig becomes clean arrays in SI units, with a list of what had to be repaired.

Every flaw of a file is either repaired, and then stands as one line in `Record.repairs`, or refused with file, row and
reason. Nothing is silently truncated or guessed.
"""

from orchestration.records.mapping import parse_mapping
from orchestration.records.reading import read_record, read_runs
from orchestration.records.record import Record, Repair
from orchestration.records.writing import write_record

__all__ = ["Record", "Repair", "parse_mapping", "read_record", "read_runs", "write_record"]
