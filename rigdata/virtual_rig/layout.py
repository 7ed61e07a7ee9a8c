"""How a campaign is laid out on disk: a folder of CSV in some dialect, or one HDF5 file."""

from __future__ import annotations

from dataclasses import dataclass, replace

from rigdata.virtual_rig.truth import VirtualRigError


@dataclass(frozen=True)
class CsvLayout:
    """Folder with `campaign.toml` and one CSV file per record."""

    delimiter: str = ","
    decimal: str = "."
    encoding: str = "utf-8"
    newline: str = "\n"
    preamble: tuple[str, ...] = ()
    units_line: bool = False
    time_name: str | None = "time"
    missing: str = ""
    trailing_delimiter: bool = False
    blank_last_lines: int = 0
    declared: bool = True

    def __post_init__(self) -> None:
        if len(self.delimiter) != 1 or self.decimal not in ".," or self.delimiter == self.decimal:
            raise VirtualRigError("delimiter must be one character, decimal '.' or ',', and the two must differ")

    @classmethod
    def plain(cls) -> CsvLayout:
        """Comma, point, UTF-8, one line of names."""
        return cls()

    @classmethod
    def german(cls) -> CsvLayout:
        """Semicolon, decimal comma, cp1252, CRLF, five preamble lines, units line, time column `Zeit`."""
        return cls(
            delimiter=";",
            decimal=",",
            encoding="cp1252",
            newline="\r\n",
            preamble=(
                "HBM catman Easy; Prüfstand Kippsegmentlager",
                "Datum: 14.03.2019 09:41:27",
                "Prüfer: Labor 2; Öl ISO VG 46, 40 °C",
                "Abtastrate: {rate} Hz",
                "Messwerte: {count}",
            ),
            units_line=True,
            time_name="Zeit",
        )

    @classmethod
    def tabbed(cls) -> CsvLayout:
        """Tab, decimal comma, UTF-8 with BOM, trailing delimiter, blank last lines, not declared."""
        return cls(
            delimiter="\t",
            decimal=",",
            encoding="utf-8-sig",
            newline="\r\n",
            preamble=("Messung\tPrüfstand 3", "{count} Werte\t{rate} Hz"),
            units_line=True,
            missing="NaN",
            trailing_delimiter=True,
            blank_last_lines=2,
            declared=False,
        )

    @classmethod
    def bare(cls) -> CsvLayout:
        """Comma, point, no time column, not declared: the rate stands in the manifest only."""
        return cls(time_name=None, declared=False)


@dataclass(frozen=True)
class Hdf5Layout:
    """One HDF5 file, a group per run, a dataset per channel."""

    precision: str | None = None
    compression: int = 4
    time_name: str | None = None

    def __post_init__(self) -> None:
        if self.precision not in (None, "float32", "float64"):
            raise VirtualRigError(f'precision must be "float32" or "float64", got {self.precision!r}')


Layout = CsvLayout | Hdf5Layout

LAYOUTS: dict[str, Layout] = {
    "hdf5": Hdf5Layout(),
    "csv": CsvLayout.plain(),
    "csv-german": CsvLayout.german(),
    "csv-tabbed": CsvLayout.tabbed(),
    "csv-bare": CsvLayout.bare(),
}


def layout_named(layout: str | Layout) -> Layout:
    """Layout by its name; one that is already a layout is returned as it is."""
    if not isinstance(layout, str):
        return layout
    if layout not in LAYOUTS:
        raise VirtualRigError(f"no layout {layout!r}; there are {', '.join(LAYOUTS)}")
    return replace(LAYOUTS[layout])
