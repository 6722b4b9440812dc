"""Files of a specimen: its parameters as TOML, which ``--params`` takes, a README and a page."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from demonstrations.characterise.characterisation import Characterisation
from fmus.kit import files
from orchestration.reporting import write_page

PARAMETERS, README, PAGE = WRITTEN = ("specimen.toml", "README.md", "specimen.html")
_README = f"""# {{name}}

A specimen of `{{model}}`. `{PARAMETERS}` has its parameters, for any command by `--params`;
`{PAGE}` shows the records.

```sh
{{command}}
```

```text
{{found}}
```
"""


def write_files(found: Characterisation, folder: Path, command: str = "") -> list[Path]:
    """Write parameters, README and page of a specimen into a folder, and return their paths.

    Parameters
    ----------
    found : Characterisation
    folder : Path
        Its name is that of the specimen; it is made if it does not exist.
    command : str
        That characterised it.

    Raises
    ------
    UserError
        If a file cannot be written.
    """
    name = folder.absolute().name
    readme = _README.format(name=name, model=found.model.name, command=command, found=found)
    files.write(folder / PARAMETERS, "\n".join(_parameters(found, name)).encode())
    files.write(folder / README, readme.encode())
    return [folder / PARAMETERS, folder / README, write_page(found, folder / PAGE, command)]


def _parameters(found: Characterisation, name: str) -> Iterator[str]:
    """Yield the lines of the file of parameters, SI."""
    yield f"# {name}, fitted to {', '.join(found.kinds)}, with 95 % intervals"
    yield f'model = "{found.model.name}"\n\n[parameters]'
    for parameter, value in found.determined.items():
        estimate = found.fit.estimates[parameter]
        low, high = estimate.interval
        text = f"{value:.10g} {estimate.unit}".strip()
        yield f'{parameter} = "{text}"  # {low:.5g} to {high:.5g}'
    yield "".join(f"# {parameter}: not determined\n" for parameter in found.missing)
