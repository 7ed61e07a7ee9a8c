"""The tables of a manifest's keys, as docs/campaigns.md shows them (`python -m tests.rigdata.manifest_tables`)."""

from rigdata.manifest.fields import ACQUISITION, CHANNEL, CSV, HOUSING, RUN, SHAFT, TOP, Field

_TABLES = {
    "": TOP, "[shaft]": SHAFT, "[housing]": HOUSING, "[acquisition]": ACQUISITION, "[csv]": CSV,
    "[channels.NAME]": CHANNEL, "[[runs]]": RUN,
}  # fmt: skip


def markdown() -> str:
    """Every key with what it holds, an example and its meaning."""
    lines = []
    for title, fields in _TABLES.items():
        lines += [f"**`{title or 'top of the file'}`**", "", "| key | holds | example | meaning |", "|---|---|---|---|"]
        for field in fields:
            if field.meaning:
                lines.append(f"| `{field.key}` | {_holds(field)} | `{field.example}` | {field.meaning} |")
        lines.append("")
    return "\n".join(lines)


_HOLDS = {
    "whole": "whole number",
    "list": "list of texts",
    "tables": "tables",
    "sign": "1 or -1",
    "calibration": "with its unit",
    "ratio": "number or %",
}


def _holds(field: Field) -> str:
    text = ", ".join(field.choices) if field.kind == "choice" else _HOLDS.get(field.kind, field.kind)
    if field.kind == "whole":
        text += f" from {field.low:g}"
    if field.required:
        return f"{text}; needed"
    if field.kind == "choice" and field.default:
        return f"{text}; default {field.default}"
    return text


if __name__ == "__main__":
    print(markdown())
