"""Opening what a command was given: the campaign, its bearing, and what they were made of."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.provenance import sha256

if TYPE_CHECKING:
    from model.bearing import Bearing
    from model.effects import Effect
    from rigdata.campaign import Campaign

HDF5 = (".h5", ".hdf5", ".hdf", ".he5")


def campaign_place(path: Path) -> Path:
    """Return `path`, or the one campaign that lies in it, as in the output folder of `tpjb simulate`.

    Parameters
    ----------
    path : Path
        As the user gave it.

    Raises
    ------
    BadInputError
        A device or pipe, which would be waited for without end.
    """
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
    """Open a campaign.

    Parameters
    ----------
    path : Path
        As the user gave it.

    Raises
    ------
    RigDataError
        It cannot be used; says every reason.
    """
    from rigdata import load_campaign

    return load_campaign(campaign_place(path))


def open_bearing(campaign: Campaign, given: Path | None) -> tuple[Bearing, dict[str, str]]:
    """Load the bearing of a campaign, or the one given instead.

    Parameters
    ----------
    campaign : Campaign
    given : Path or None
        Option --bearing.

    Returns
    -------
    bearing : Bearing
    inputs : dict
        SHA-256 of the file given; empty if the campaign carries the bearing, whose bytes are known by the campaign.

    Raises
    ------
    BadInputError
        The campaign carries no bearing file and none was given.
    """
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
    """Refuse effects of a file that a bearing cannot have, such as one of a pad that it lacks.

    Parameters
    ----------
    effects : sequence of Effect
    path : Path, optional
        The file they come from.
    bearing : Bearing

    Raises
    ------
    BadInputError
    """
    if path is None:
        return
    from model.effects import EffectError, apply_effects
    from model.pivots import pivot_laws
    from model.setup import Setup

    try:
        apply_effects(Setup(bearing, pivot_laws("rigid", bearing)), effects)
    except EffectError as error:
        raise BadInputError(f"--effects {path.name}: {error}") from error


def table_inputs(
    command: str, path: Path, bearing: Path | None, reading_error: str | None
) -> tuple[Bearing, float | None, dict[str, str]]:
    """What stands beside a table of coefficients: its bearing, how far its values hold, and what both were made of.

    Parameters
    ----------
    command : str
        Its name, for messages.
    path : Path
        Option --coefficients.
    bearing : Path, optional
        Option --bearing.
    reading_error : str, optional
        Option --reading-error.

    Raises
    ------
    BadInputError
        No bearing, or a share that is none.
    """
    from model.bearing_file import load_bearing
    from model.units import parse_quantity

    refuse_special(path, bearing)
    if not path.is_file():
        raise BadInputError(f"{path}: no such file. Give the table of coefficients as CSV.")
    if bearing is None:
        raise BadInputError(f"{command} --coefficients: a table names no bearing. Add --bearing FILE.")
    error = None if reading_error is None else float(parse_quantity(reading_error, "ratio", "--reading-error"))
    return load_bearing(bearing), error, {path.name: sha256(path), bearing.name: sha256(bearing)}
