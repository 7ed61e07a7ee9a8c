"""What an export refuses."""

from __future__ import annotations

from tpjb_ident.errors import TpjbError


class ExportError(TpjbError):
    """What was given cannot be exported; says which format, column or point, and what to do."""
