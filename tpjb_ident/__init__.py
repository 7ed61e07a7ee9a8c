"""Identify, predict and compare the dynamic coefficients of tilting-pad journal bearings.

```python
import tpjb_ident as ti

result = ti.identify("rocker-A")  # a path, or what ti.load_campaign gives
found = ti.diagnose("rocker-A")
print(found.summary())
bearing = ti.load_bearing("rocker.toml")
p = ti.predict(bearing, load=5000.0, speed=2 * np.pi * 22, excitation=2 * np.pi * 25, pivots="kirk")
```

Everything takes and gives SI floats or arrays (radians, rad/s), or pint quantities.
"""

import importlib
from typing import Any

__version__ = "0.1.0"

#: Where each public name lives; imported on first use, so that `import tpjb_ident` stays quick.
_HOMES = {
    "Campaign": "rigdata",
    "OperatingPoint": "rigdata",
    "Problem": "rigdata",
    "RigDataError": "rigdata",
    "check_campaign": "tpjb_ident.check.campaign",
    "load_campaign": "rigdata",
    "DynamicStiffness": "tpjb_ident.estimators.stiffness",
    "IdentifySettings": "tpjb_ident.identification.identify",
    "estimate_dynamic_stiffness": "tpjb_ident.estimators.estimate",
    "identify": "tpjb_ident.identification.identify",
    "r_matrix": "tpjb_ident.estimators.r_matrix",
    "fit_pivots": "tpjb_ident.pivot.fit",
    "pivot_table": "tpjb_ident.pivot.tables",
    "write_pivots": "tpjb_ident.pivot.tables",
    "measure_locus": "tpjb_ident.clearance.locus",
    "measure_clearance": "tpjb_ident.clearance.measure",
    "diagnose": "tpjb_ident.diagnosis.from_python",
    "plan": "tpjb_ident.diagnosis.from_python",
    "export": "tpjb_ident.exports.write",
    "Bearing": "model.bearing",
    "BearingError": "model.bearing",
    "load_bearing": "model.bearing_file",
    "Effect": "model.effects",
    "EffectError": "model.effects",
    "load_effects": "model.effects",
    "load_pivots": "model.pivots",
    "Prediction": "model.prediction",
    "predict": "model.predict",
    "CompareSettings": "tpjb_ident.compare.comparison",
    "compare_campaign": "tpjb_ident.compare.comparison",
    "write_report": "tpjb_ident.report.comparison_page",
    "plots": "tpjb_ident.report.plots",
}

#: Arguments that are looked at before a function is called: the path of a campaign or a bearing does as well.
_CHECKED = {
    "identify": "campaign", "fit_pivots": "campaign pivot_angles", "measure_locus": "campaign",
    "measure_clearance": "campaign pivot_angles",
    "compare_campaign": "campaign bearing", "predict": "bearing", "load_campaign": "path", "load_bearing": "source",
    "load_effects": "path", "load_pivots": "path", "pivot_table": "curves", "write_pivots": "path curves",
    "write_report": "folder comparison",
}  # fmt: skip

__all__ = sorted([*_HOMES, "__version__"])


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        from rigdata.near_names import nearest_name

        near = nearest_name(name, _HOMES)
        hint = f"; did you mean {near!r}?" if near else ""
        raise AttributeError(f"module 'tpjb_ident' has no attribute {name!r}{hint}")
    home = _HOMES[name]
    if home.startswith("model"):
        from tpjb_ident.model_guard import check_model

        check_model()
    module = importlib.import_module(home)
    value: Any = module if name == "plots" else getattr(module, name)
    if callable(value) and not isinstance(value, type):
        from tpjb_ident.arguments import checked

        settings = __getattr__("IdentifySettings") if name == "identify" else None
        value = checked(value, name, _CHECKED.get(name, ""), settings)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
