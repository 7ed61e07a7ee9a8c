"""Opening what a command was given: the campaign, its bearing, and what they were made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.provenance import sha256

if TYPE_CHECKING:
    from model.bearing import Bearing
    from model.effects import Effect
    from rigdata.campaign import Campaign
    from tpjb_ident.compare.coefficient_table import TableSource

HDF5 = (".h5", ".hdf5", ".hdf", ".he5")


def campaign_place(path: Path) -> Path:
    """Return `path`, or the one campaign that lies in it, as in the output folder of `tpjb simulate`."""
    refuse_special(path)
    if not path.is_dir() or (path / "campaign.toml").exists():
        return path
    inside = [p for p in sorted(path.iterdir()) if p.suffix.lower() in HDF5 or (p / "campaign.toml").is_file()]
    return inside[0] if len(inside) == 1 else path


def refuse_special(*paths: Path | None) -> None:
    """Let ordinary files, folders and names of nothing pass; refuse devices and pipes."""
    for path in paths:
        if path is not None and path.exists() and not (path.is_file() or path.is_dir()):
            raise BadInputError(f"{path}: is a device or a pipe, not a file. Give an ordinary file.")


def open_campaign(path: Path) -> Campaign:
    """Open a campaign."""
    from rigdata import load_campaign

    return load_campaign(campaign_place(path))


def open_bearing(campaign: Campaign, given: Path | None) -> tuple[Bearing, dict[str, str]]:
    """Load the bearing of a campaign, or the one given instead."""
    from model.bearing_file import load_bearing, parse_bearing

    refuse_special(given)
    if given is not None:
        return load_bearing(given), {given.name: sha256(given)}
    if not campaign.bearing_text:
        raise BadInputError(
            f"campaign {campaign.id}: carries no bearing file ({campaign.bearing_name or 'none is named'}). "
            "Give one with --bearing FILE."
        )
    return parse_bearing(campaign.bearing_text, campaign.bearing_name), {}


def refuse_impossible(effects: Sequence[Effect], path: Path | None, bearing: Bearing) -> None:
    """Refuse effects of a file that a bearing cannot have, such as one of a pad that it lacks."""
    if path is None:
        return
    from model.effects import EffectError, apply_effects
    from model.pivots import pivot_laws
    from model.setup import Setup

    try:
        apply_effects(Setup(bearing, pivot_laws("rigid", bearing)), effects)
    except EffectError as error:
        raise BadInputError(f"--effects {path.name}: {error}") from error


@dataclass(frozen=True)
class Data:
    """What stands beside the model: a campaign, or a table of coefficients in its place."""

    source: Campaign | TableSource
    bearing: Bearing
    inputs: dict[str, str]
    path: Path
    typed: str
    given: Path | None
    reading_error: float | None = None

    @property
    def bearing_name(self) -> Path | str | None:
        """The bearing file that is used: the one given, or the one that the campaign names."""
        return self.given or getattr(self.source, "bearing_name", None)


def open_data(
    command: str, campaign: Path | None, table: Path | None, bearing: Path | None, reading_error: str | None
) -> Data:
    """Open a campaign with its bearing, or a table of coefficients with the one given."""
    if table is None and campaign is not None:
        source = open_campaign(campaign)
        drawn, given = open_bearing(source, bearing)
        return Data(source, drawn, source.fingerprint() | given, campaign, str(campaign), bearing)
    if table is None or campaign is not None:
        raise BadInputError(
            f"{command}: give a campaign, or --coefficients TABLE.csv with --bearing FILE; one of them."
        )
    from model.bearing_file import load_bearing
    from rigdata.units import parse_quantity
    from tpjb_ident.compare.coefficient_table import TableSource

    refuse_special(table, bearing)
    if not table.is_file():
        raise BadInputError(f"{table}: no such file. Give the table of coefficients as CSV.")
    if bearing is None:
        raise BadInputError(f"{command} --coefficients: a table names no bearing. Add --bearing FILE.")
    error = None if reading_error is None else float(parse_quantity(reading_error, "ratio", "--reading-error"))
    inputs = {table.name: sha256(table), bearing.name: sha256(bearing)}
    return Data(
        TableSource(table.stem), load_bearing(bearing), inputs, table, f"--coefficients {table}", bearing, error
    )
