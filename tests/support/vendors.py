"""Files in the manner of twelve vendors' instruments, written without any code of the product.

Each holds the same course of a current and a voltage. What their instruments write around it is
their own: preambles, encodings, decimal marks, dates, units, columns nobody asks for. A file knows
on which lines its rows are, so that it can be damaged in one of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from decimal import Decimal
from typing import NamedTuple

UNITS = {"current": "A", "voltage": "V"}
"""Signals of a model of a cell that all the files can be held against."""
ROWS = 60
PERIOD = Decimal("0.5")
START = datetime(2026, 1, 31, 23, 59, 45)
"""Half-way through the record a new day and a new month begin."""


class Sample(NamedTuple):
    """One row: seconds since the first, A, V; exact in decimal digits."""

    time: Decimal
    current: Decimal
    voltage: Decimal

    @property
    def instant(self) -> datetime:
        return START + timedelta(seconds=float(self.time))


def course() -> list[Sample]:
    """Return a current that steps and a voltage that follows it, to a tenth of a milli-unit."""
    samples = []
    voltage = Decimal("3.7")
    for k in range(ROWS):
        current = Decimal("1.2345") * (-1 if k // 10 % 2 else 1)
        voltage += (Decimal("0.0031") if current > 0 else Decimal("-0.0027")) + k % 3 * Decimal(
            "0.0001"
        )
        samples.append(Sample(k * PERIOD, current, voltage))
    return samples


@dataclass(frozen=True)
class VendorFile:
    """A file of one vendor.

    Attributes
    ----------
    vendor, name : str
    lines : tuple of str
        Without their ends.
    first : int
        Number of the line, from 1, that has the first row of data.
    delimiter, encoding, end : str
    mapping : tuple of str
        What says which column is which signal, as ``--map`` takes it.
    cells : dict of str to int
        Place of ``current`` and ``voltage`` in a row.
    clocks : tuple of int
        Places of everything in a row that is a time.
    no_day : str
        A date in the form of the first clock that no calendar has.
    """

    vendor: str
    name: str
    lines: tuple[str, ...]
    first: int
    delimiter: str
    mapping: tuple[str, ...]
    cells: dict[str, int]
    clocks: tuple[int, ...]
    encoding: str = "utf-8"
    end: str = "\n"
    no_day: str = ""

    def content(self) -> bytes:
        return (self.end.join(self.lines) + self.end).encode(self.encoding)

    def with_row(self, k: int, change: Callable[[list[str]], Sequence[str]]) -> VendorFile:
        """Return the file with other cells in row k of the data."""
        lines = list(self.lines)
        at = self.first - 1 + k
        lines[at] = self.delimiter.join(change(lines[at].split(self.delimiter)))
        return replace(self, lines=tuple(lines))

    def with_cell(self, k: int, place: int, text: str) -> VendorFile:
        """Return the file with another cell in row k of the data."""
        return self.with_row(k, lambda cells: [*cells[:place], text, *cells[place + 1 :]])


def _german(value: Decimal | str) -> str:
    return str(value).replace(".", ",")


def _hours(seconds: Decimal) -> str:
    whole = int(seconds)
    return f"{whole // 3600:02d}:{whole // 60 % 60:02d}:{whole % 60:02d}"


def _thousandths(seconds: Decimal) -> str:
    return f"{int(seconds * 1000) % 1000:03d}"


def biologic() -> VendorFile:
    """EC-Lab ASCII file: 30 lines of settings, name/unit, decimal commas, Windows encoding."""
    settings = [
        "EC-Lab ASCII FILE",
        "Nb header lines : 30                        ",
        "",
        "Galvanostatic Cycling with Potential Limitation",
        "",
        "Run on channel : 3 (SN 12345)",
        "Ewe ctrl range : min = 0,00 V, max = 5,00 V",
        "Acquisition started on : 01/31/2026 23:59:45.000",
        "Cell temperature : 25,0 °C ± 0,5",
        "Electrode surface area : 0,001 cm²",
        "Characteristic mass : 0,001 g",
        "Battery capacity : 2,500 A.h",
    ]
    settings += [f"Step{k:<16d}{k:<20d}{k + 1:<20d}0,500" for k in range(17)]
    header = "mode\tox/red\terror\tNs changes\ttime/s\tcontrol/V/mA\tEwe/V\t<I>/mA\tdQ/mA.h"
    rows = [
        f"1\t{int(s.current > 0)}\t0\t0\t{_german(f'{s.time:.15E}')}\t0,0\t{_german(s.voltage)}"
        f"\t{_german(s.current * 1000)}\t{_german(s.time / 1000)}"
        for s in course()
    ]
    return VendorFile(
        "BioLogic",
        "cell_C03.mpt",
        (*settings, header, *rows),
        31,
        "\t",
        ("Ewe=voltage", "<I>=current"),
        {"voltage": 6, "current": 7},
        (4,),
        "cp1252",
        "\r\n",
    )


def arbin() -> VendorFile:
    """MITS Pro CSV: name(unit), a date and two clocks, one of which starts anew in each step."""
    header = (
        "Data_Point,Date_Time,Test_Time(s),Step_Time(s),Cycle_Index,Step_Index,Current(A),"
        "Voltage(V),Charge_Capacity(Ah),dV/dt(V/s),ACR(Ohm)"
    )
    rows = [
        f"{k + 1},{s.instant:%m/%d/%Y %H:%M:%S}.{_thousandths(s.time)},{s.time},"
        f"{k % 10 * PERIOD},1,{k // 10},{s.current},{s.voltage},{k * Decimal('0.00017')},0.0001,0"
        for k, s in enumerate(course())
    ]
    return VendorFile(
        "Arbin",
        "cell_Channel_7.CSV",
        (header, *rows),
        2,
        ",",
        ("Current=current", "Voltage=voltage"),
        {"current": 6, "voltage": 7},
        (1, 2, 3),
        end="\r\n",
    )


def neware() -> VendorFile:
    """BTSDA CSV: hh:mm:ss of the step and in total, states in words, a byte order mark."""
    header = (
        "DataPoint,Cycle Index,Step Index,Step Type,Time,Total Time,Current(mA),Voltage(V),"
        "Capacity(Ah),Date"
    )
    rows = [
        f"{k + 1},1,{k // 10},{'CC Chg' if s.current > 0 else 'CC DChg'},"
        f"{_hours(k % 10 * PERIOD)}.{_thousandths(k % 10 * PERIOD)},"
        f"{_hours(s.time)}.{_thousandths(s.time)},{s.current * 1000},{s.voltage},"
        f"{k * Decimal('0.00017')},{s.instant:%Y-%m-%d %H:%M:%S}"
        for k, s in enumerate(course())
    ]
    return VendorFile(
        "Neware",
        "127.0.0.1_BTS_3_8.csv",
        (header, *rows),
        2,
        ",",
        ("Current=current", "Voltage=voltage"),
        {"current": 6, "voltage": 7},
        (4, 5, 9),
        "utf-8-sig",
    )


def maccor() -> VendorFile:
    """Text export: a line about the test, days and hours since the start, units as names."""
    about = "Today's Date\t02/03/2026\tDate of Test:\t01/31/2026\tFilename:\tC:\\data\\cell.042"
    header = (
        "Rec#\tCyc#\tStep\tTestTime\tStepTime\tAmp-hr\tWatt-hr\tAmps\tVolts\tState\tES\tDPt Time"
    )
    rows = [
        f"{k + 1}\t0\t{k // 10}\t  0d {_hours(s.time)}.{_thousandths(s.time)}\t"
        f"  0d {_hours(k % 10 * PERIOD)}.{_thousandths(k % 10 * PERIOD)}\t0.0000\t0.0000\t"
        f"{s.current}\t{s.voltage}\t{'C' if s.current > 0 else 'D'}\t1\t"
        f"{s.instant:%m/%d/%Y %I:%M:%S %p}"
        for k, s in enumerate(course())
    ]
    return VendorFile(
        "Maccor",
        "cell.042.txt",
        (about, header, *rows),
        3,
        "\t",
        ("Amps=current", "Volts=voltage"),
        {"current": 7, "voltage": 8},
        (3, 4, 11),
        end="\r\n",
    )


def gamry() -> VendorFile:
    """DTA file: tagged settings, a row of units, an empty cell before every row."""
    settings = [
        "EXPLAIN",
        "TAG\tCHRONOP",
        "TITLE\tLABEL\tChronopotentiometry Scan\tTest &Identifier",
        "DATE\tLABEL\t1/31/2026\tDate",
        "TIME\tLABEL\t23:59:45\tTime",
        "NOTES\tNOTES\t1\t&Notes...",
        "\t20 °C, second cell",
        "PSTAT\tPSTAT\tIFC1010-12345\tPotentiostat",
        "SAMPLETIME\tQUANT\t5.00000E-001\tSample Period (s)",
        "AREA\tQUANT\t1.00000E+000\tSample Area (cm^2)",
        f"CURVE\tTABLE\t{ROWS}",
        "\tPt\tT\tVf\tIm\tVu\tSig\tAch\tIERange\tOver",
        "\t#\ts\tV vs. Ref.\tA\tV\tV\tV\t#\tbits",
    ]
    rows = [
        f"\t{k}\t{s.time:.5E}\t{s.voltage:.5E}\t{s.current:.5E}\t0.00000E+000\t0.00000E+000"
        "\t0.00000E+000\t9\t..........."
        for k, s in enumerate(course())
    ]
    return VendorFile(
        "Gamry",
        "cell.DTA",
        (*settings, *rows),
        len(settings) + 1,
        "\t",
        ("Vf=voltage", "Im=current"),
        {"voltage": 3, "current": 4},
        (2,),
        "cp1252",
        "\r\n",
    )


def keysight() -> VendorFile:
    """BenchLink CSV in UTF-16: a form about the scan, dates with thousandths behind a colon."""
    form = [
        "Name:,Scan 4,,",
        "Owner:,Lab 2,,",
        "Comments:,,,",
        "Acquisition Date:,1/31/2026 11:59:45 PM,,",
        "Instrument:,34970A,Address:,GPIB0::9::INSTR",
        "Total Channels:,2,,",
        "Channel,Name,Function,Range",
        "101,,DC Voltage,10 V",
        "102,,DC Current,Auto",
        "",
        "Scan,Time,101 (VDC),102 (ADC)",
    ]
    rows = [
        f"{k + 1},{s.instant:%m/%d/%Y %H:%M:%S}:{_thousandths(s.time)},{s.voltage},{s.current}"
        for k, s in enumerate(course())
    ]
    return VendorFile(
        "Keysight",
        "Scan 4.csv",
        (*form, *rows),
        len(form) + 1,
        ",",
        ("101=voltage", "102=current"),
        {"voltage": 2, "current": 3},
        (1,),
        "utf-16",
        "\r\n",
    )


def labview() -> VendorFile:
    """LVM file with decimal commas and two headers."""
    headers = [
        "LabVIEW Measurement\t",
        "Writer_Version\t2",
        "Reader_Version\t2",
        "Separator\tTab",
        "Decimal_Separator\t,",
        "Multi_Headings\tNo",
        "X_Columns\tOne",
        "Time_Pref\tAbsolute",
        "Date\t2026/01/31",
        "Time\t23:59:45,000",
        "***End_of_Header***\t",
        "",
        "Channels\t2\t\t",
        f"Samples\t{ROWS}\t{ROWS}\t",
        "Date\t2026/01/31\t2026/01/31\t",
        "Time\t23:59:45,0\t23:59:45,0\t",
        "Y_Unit_Label\tVolts\tAmps\t",
        "X_Dimension\tTime\tTime\t",
        "X0\t0,0E+0\t0,0E+0\t",
        "Delta_X\t0,500000\t0,500000\t",
        "***End_of_Header***\t\t\t",
        "X_Value\tCell\tShunt\tComment",
    ]
    rows = [f"{_german(s.time)}\t{_german(s.voltage)}\t{_german(s.current)}" for s in course()]
    return VendorFile(
        "LabVIEW",
        "test_001.lvm",
        (*headers, *rows),
        len(headers) + 1,
        "\t",
        ("Cell=voltage", "Shunt=current"),
        {"voltage": 1, "current": 2},
        (0,),
        end="\r\n",
    )


def diadem() -> VendorFile:
    """DIAdem CSV of DAQmx channels: properties, names, units; dates of ISO 8601."""
    properties = [
        "DIAdem ASCII export",
        "Datasetname;Cell 7",
        "Author;J. Müller",
        "",
        "Timestamp;Dev1/ai0;Dev1/ai1;Dev1/ai2",
        ";V;mA;°C",
    ]
    rows = [
        f"{s.instant:%Y-%m-%dT%H:%M:%S}.{_thousandths(s.time)}000;{s.voltage};"
        f"{s.current * 1000};24.{k % 10}"
        for k, s in enumerate(course())
    ]
    return VendorFile(
        "NI DIAdem",
        "cell7.csv",
        (*properties, *rows),
        len(properties) + 1,
        ";",
        ("Dev1/ai0=voltage", "Dev1/ai1=current"),
        {"voltage": 1, "current": 2},
        (0,),
        end="\r\n",
        no_day="2026-13-31T23:59:57.500000",
    )


def opendaq() -> VendorFile:
    """CSV of the openDAQ recorder: no column of time, whose ticks a comment defines."""
    about = (
        "# domain;unit=seconds;resolution=1/1000;delta=500;origin=1970-01-01T00:00:00;"
        "starting_tick=817;"
    )
    header = '"U (V)","I (mA)","T (°C)"'
    rows = [f"{s.voltage},{s.current * 1000},24.{k % 10}" for k, s in enumerate(course())]
    return VendorFile(
        "openDAQ",
        "output.csv",
        (about, header, *rows),
        3,
        ",",
        ("U=voltage", "I=current"),
        {"voltage": 0, "current": 1},
        (),
    )


def tektronix() -> VendorFile:
    """CSV of a mixed-domain oscilloscope: settings, lone commas, time before the trigger."""
    settings = [
        "Model,MDO3014",
        "Firmware Version,1.26",
        "",
        "Waveform Type,ANALOG,",
        "Point Format,Y,",
        "Horizontal Units,s,",
        "Horizontal Scale,4,",
        "Horizontal Delay,0,",
        "Sample Interval,0.5,",
        f"Record Length,{ROWS},",
        "Gating,0.0% to 100.0%,",
        "Probe Attenuation,10,1",
        "Vertical Units,V,A",
        "Vertical Scale,0.5,0.2",
        ",,",
        ",,",
        "Label,,",
        "TIME,CH1,CH2",
    ]
    rows = [f"{s.time - 10:.7e},{s.voltage},{s.current}" for s in course()]
    return VendorFile(
        "Tektronix",
        "T0001.CSV",
        (*settings, *rows),
        len(settings) + 1,
        ",",
        ("CH1=voltage", "CH2=current"),
        {"voltage": 1, "current": 2},
        (0,),
        end="\r\n",
    )


def catman() -> VendorFile:
    """HBM catman text: German words, dates and decimal commas, names and units in two rows."""
    about = [
        "HBM catmanEasy V5.2\tGerät: QuantumX MX840B",
        "Messung vom 31.01.2026 23:59:45",
        "Messrate: 2 Hz, Kanäle: 3",
        "Größe der Prüfzelle\t18650",
        "",
        "Zeit\tSpannung Zelle 1\tStrom\tOberflächentemperatur",
        "\tV\tA\t°C",
    ]
    rows = [
        f"{s.instant:%d.%m.%Y %H:%M:%S},{_thousandths(s.time)}\t{_german(s.voltage)}"
        f"\t{_german(s.current)}\t24,{k % 10}"
        for k, s in enumerate(course())
    ]
    return VendorFile(
        "HBM catman",
        "MX840_Zelle.asc",
        (*about, *rows),
        len(about) + 1,
        "\t",
        ("Spannung Zelle 1=voltage", "Strom=current"),
        {"voltage": 1, "current": 2},
        (0,),
        "cp1252",
        "\r\n",
        no_day="31.02.2026 23:59:57,500",
    )


def excel() -> VendorFile:
    """German Excel: semicolons, latin-1, date and time of day apart, points between thousands."""
    header = "Datum;Uhrzeit;Strom [mA];Klemmenspannung in mV;Temperatur (°C);Bemerkung"
    rows = [
        f"{s.instant:%d.%m.%Y};{s.instant:%H:%M:%S},{_thousandths(s.time)[0]};"
        f"{_grouped(s.current * 1000)};{_grouped(s.voltage * 1000)};24,{k % 10};"
        f"{'Übergang' if k % 10 == 0 else ''}"
        for k, s in enumerate(course())
    ]
    return VendorFile(
        "Excel, German",
        "Messung Zelle.csv",
        (header, *rows),
        2,
        ";",
        ("Strom=current", "Klemmenspannung=voltage"),
        {"current": 2, "voltage": 3},
        (0, 1),
        "latin-1",
        "\r\n",
        no_day="32.01.2026",
    )


def _grouped(value: Decimal) -> str:
    """Write 1234.5 as 1.234,5."""
    return f"{value:,}".translate(str.maketrans(",.", ".,"))


VENDORS: tuple[Callable[[], VendorFile], ...] = (
    biologic,
    arbin,
    neware,
    maccor,
    gamry,
    keysight,
    labview,
    diadem,
    opendaq,
    tektronix,
    catman,
    excel,
)


class Damage(NamedTuple):
    """A damaged file, the line that is at fault, and a word of the reason."""

    what: str
    file: VendorFile
    line: int
    reason: str


def damages(file: VendorFile) -> list[Damage]:
    """Return five damages of a file."""
    word = file.with_cell(20, file.cells["voltage"], "jammed")
    short = file.with_row(30, lambda cells: cells[: len(cells) // 2 or 1])
    long = file.with_row(12, lambda cells: [*cells, "7", "8"])
    hole = file
    for k in range(40, 48):
        hole = hole.with_cell(k, file.cells["current"], "")
    found = [
        Damage("a word among numbers", word, file.first + 20, "jammed"),
        Damage("a row that is cut short", short, file.first + 30, "cells where the header has"),
        Damage("a row that is too long", long, file.first + 12, "cells where the header has"),
        Damage("a long hole in an input", hole, file.first + 40, "no value"),
    ]
    return [*found, _fifth(file)]


def _fifth(file: VendorFile) -> Damage:
    """Return a damage of the clock, or of what it is made from."""
    if not file.clocks:
        still = file.lines[0].replace("delta=500", "delta=0")
        return Damage(
            "a clock that stands", replace(file, lines=(still, *file.lines[1:])), 1, "delta"
        )
    if file.no_day:
        wrong = file.with_cell(25, file.clocks[0], file.no_day)
        return Damage("a day that is none", wrong, file.first + 25, file.no_day)
    restarted = file
    cells = [line.split(file.delimiter) for line in file.lines[file.first - 1 :]]
    for k in range(30, ROWS):
        for place in file.clocks:
            restarted = restarted.with_cell(k, place, cells[k - 30][place])
    return Damage("a clock that starts again", restarted, file.first + 30, "restarts")
