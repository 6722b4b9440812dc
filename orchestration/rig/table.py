"""Values out of a TOML file written by hand: each is there and of its kind, or one line says what is not."""

from __future__ import annotations

import datetime
import math
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from fmus.kit.errors import UserError, suggestion


class Table:
    """One table of a file.

    Parameters
    ----------
    file : Path or str
        For messages.
    name : str
        With dots, as TOML writes it; empty at the top.
    values : Mapping of str to object
    """

    def __init__(self, file: Path | str, name: str, values: Mapping[str, Any]):
        self.file, self.name, self._values = file, name, values
        self._asked: list[str] = []

    @classmethod
    def read(cls, file: Path) -> Table:
        """Read a whole file.

        Raises
        ------
        UserError
            If it cannot be read or is no TOML.
        """
        try:
            return cls(file, "", tomllib.loads(file.read_text(encoding="utf-8-sig")))
        except UnicodeDecodeError as error:
            raise UserError(f"{file}: not a text in UTF-8") from error
        except tomllib.TOMLDecodeError as error:
            raise UserError(f"{file}: {' '.join(str(error).split())}") from error
        except OSError as error:
            raise UserError(f"{file}: cannot be read: {error.strerror}") from error

    def wrong(self, key: str, allowed: str) -> UserError:
        """Make the error for a value; the caller raises it."""
        where = f"{self.file}: [{self.name}] " if self.name else f"{self.file}: "
        value = self._values.get(key)
        return UserError(
            f"{where}{key} {'is missing' if value is None else f'= {_shown(value)}'}: {allowed}"
        )

    def __contains__(self, key: str) -> bool:
        return key in self._values

    def _get(self, key: str, default: Any, is_right: Callable[[Any], bool], allowed: str) -> Any:
        self._asked.append(key)
        value = self._values.get(key, default)
        if key not in self._values and default is not None:
            return value
        if not is_right(value):
            raise self.wrong(key, allowed)
        return value

    def number(self, key: str, default: float | None = None, above: float = -math.inf) -> float:
        """Return a finite number.

        Raises
        ------
        UserError
            If it is missing without a default, is none, or is not above a bound.
        """
        allowed = (
            "a finite number" + (f" above {above:g}" if above > -math.inf else "") + " is wanted"
        )
        return float(self._get(key, default, lambda v: _is_number(v) and v > above, allowed))

    def maybe(self, key: str, above: float = -math.inf) -> float | None:
        """Return a finite number, or None if there is none."""
        self._asked.append(key)
        return self.number(key, above=above) if key in self else None

    def text(self, key: str, default: str | None = None) -> str:
        """Return a text that is not empty."""
        found: str = self._get(
            key, default, lambda v: isinstance(v, str) and v.strip() != "", "a text is wanted"
        )
        return found

    def choice(self, key: str, default: Any, among: tuple[Any, ...]) -> Any:
        """Return one of several values."""
        allowed = f"allowed are {', '.join(map(_shown, among))}"
        return self._get(
            key, default, lambda v: any(v == a and type(v) is type(a) for a in among), allowed
        )

    def texts(self, key: str) -> tuple[str, ...]:
        """Return a list of texts, empty if it is not there."""

        def is_right(value: Any) -> bool:
            return isinstance(value, list) and all(isinstance(item, str) for item in value)

        return tuple(self._get(key, [], is_right, "a list of texts is wanted"))

    def interval(self, key: str) -> tuple[float, float]:
        """Return a lower and an upper bound."""

        def is_right(value: Any) -> bool:
            return (
                isinstance(value, list)
                and len(value) == 2
                and all(map(_is_number, value))
                and value[0] < value[1]
            )

        low, high = self._get(
            key, None, is_right, "[low, high] of two finite numbers is wanted, the lower one first"
        )
        return float(low), float(high)

    def date(self, key: str) -> datetime.date:
        """Return a date."""
        found: datetime.date = self._get(
            key,
            None,
            lambda v: isinstance(v, datetime.date),
            "a date is wanted, such as 2007-05-01",
        )
        return found

    def tables(self, key: str) -> dict[str, Table]:
        """Return the tables within a table, by name; none if it is not there."""

        def is_right(value: Any) -> bool:
            return isinstance(value, dict) and all(
                isinstance(table, dict) for table in value.values()
            )

        found = self._get(key, {}, is_right, f"tables are wanted, such as [{key}.current]")
        name = f"{self.name}.{key}" if self.name else key
        return {
            inner: Table(self.file, f"{name}.{inner}", values) for inner, values in found.items()
        }

    def table(self, key: str) -> Table:
        """Return the table within a table, an empty one if it is not there."""
        values = self._get(key, {}, lambda v: isinstance(v, dict), f"a table is wanted, [{key}]")
        return Table(self.file, f"{self.name}.{key}" if self.name else key, values)

    def finish(self) -> None:
        """Refuse what nobody has asked for.

        Raises
        ------
        UserError
            If there is such a key.
        """
        for key in self._values:
            if key not in self._asked:
                known = list(dict.fromkeys(self._asked))
                raise self.wrong(key, f"there is no such key{suggestion(key, known)}")


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _shown(value: Any) -> str:
    text = repr(value) if isinstance(value, (str, list)) else str(value)
    return text if len(text) <= 60 else text[:57] + "..."
